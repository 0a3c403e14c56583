"""The tables of a report, from the answers about an application."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from services.codesign.comparison import OWN
from services.codesign.motor_data import DIMENSIONS, MotorData
from services.codesign.robot import Robot
from services.report.html_table import NOTHING, HtmlTable, number, percent, small, vector
from services.report.style import DIMENSION_NAMES, method_name
from services.report.words import QUANTITIES
from shared.contracts.certificates import Certificate
from shared.contracts.comparisons import ComparisonAnswer, DesignAnswer
from shared.contracts.motions import MotionResult, TaskList, TaskResult


def robot_table(robot: Robot) -> HtmlTable:
    """Joints."""
    rows = [
        [
            str(k + 1),
            number(robot.gear_ratio[k]),
            f"{number(robot.joint_lower[k])} … {number(robot.joint_upper[k])}",
            number(robot.joint_speed_limit[k]),
            number(robot.link_mass[k]),
            f"{number(robot.viscous_friction[k])}, {number(robot.coulomb_friction[k])}",
        ]
        for k in range(robot.joints)
    ]
    columns = ["joint", "gear", "range\nrad", "speed limit\nrad/s", "link mass\nkg", "friction\nN m s/rad, N m"]
    return HtmlTable(f"Robot {robot.name}: {robot.joints} joints", columns, rows)


def task_table(tasks: Sequence[Mapping[str, Any]]) -> HtmlTable:
    """The tasks as they were understood."""
    rows = [
        [
            str(k),
            str(task["name"]),
            vector(task["start_rad"]),
            vector(task["end_rad"]),
            number(task["payload_kg"]),
            number(task.get("duration_s")),
            number(task.get("weight", 1.0)),
        ]
        for k, task in enumerate(tasks)
    ]
    columns = ["", "task", "start\nrad", "end\nrad", "payload\nkg", "given time\ns", "weight"]
    return HtmlTable("Tasks", columns, rows, left=4)


def constants_table(motor: MotorData) -> HtmlTable:
    """Constants, limits and bounds of the motors."""
    wire = motor.to_wire()
    bounds = wire.pop("bounds_mm")
    rows = [[name, number(value)] for name, value in wire.items()]
    rows += [[f"bounds of {name} [mm]", f"{number(low)} … {number(high)}"] for name, (low, high) in bounds.items()]
    return HtmlTable("Motor constants, limits and bounds", ["name, with its unit", "value"], rows)


def dimension_table(design: DesignAnswer) -> HtmlTable:
    """Lengths and derived parameters of every motor."""
    rows = [
        [f"{DIMENSION_NAMES[name]} {name} [mm]", *(f"{row[k]:.3f}" for row in design.design_mm)]
        for k, name in enumerate(DIMENSIONS)
    ]
    if design.gear_ratio is not None:
        rows.append(["gear ratio, free", *(number(ratio) for ratio in design.gear_ratio)])
    rows += [
        [_parameter_words(name), *(number(sheet["parameters"][name]) for sheet in design.motors)]
        for name in design.motors[0]["parameters"]
    ]
    return HtmlTable("Dimensions and parameters", ["", *(f"motor {s['joint']}" for s in design.motors)], rows)


def _parameter_words(name: str) -> str:
    """flux_linkage_Wb: flux linkage [Wb]."""
    units = {
        "_Nm_per_A": "N m/A",
        "_kg_m2": "kg m²",
        "_Wb": "Wb",
        "_H": "H",
        "_ohm": "Ω",
        "_Nm": "N m",
        "_kg": "kg",
        "_mm": "mm",
    }
    for suffix, unit in units.items():
        if name.endswith(suffix):
            return f"{name.removesuffix(suffix).replace('_', ' ')} [{unit}]"
    return name.replace("_", " ")


def totals_table(comparison: ComparisonAnswer) -> HtmlTable:
    """Methods side by side."""
    weighted = comparison.objective == "weighted"
    columns = ["method", *(["objective\n1"] if weighted else []), "time\ns", "energy\nV² s", "electrical\nJ"]
    columns += ["copper loss\nJ", "regret\n%"]
    rows = []
    for name, totals in comparison.methods.items():
        regret = comparison.regret.get(name)
        measures = [totals.total_objective] if weighted else []
        measures += [totals.total_time_s, totals.total_energy_V2s]
        measures += [totals.total_electrical_energy_J, totals.total_copper_loss_J]
        shown = NOTHING if regret is None else percent(regret.total)
        rows.append([method_name(name), *(number(value, 5) for value in measures), shown])
    count = len(comparison.tasks_compared)
    caption = f"Totals over the {count} tasks that every method solved" if count > 1 else "One task, with every method"
    return HtmlTable(caption, columns, rows)


MOST_LIMITS = 12
"""Of those that would bring most."""


def limit_tables(comparison: ComparisonAnswer, method: str) -> list[HtmlTable]:
    """What relaxing each limit would bring, with the application's design and with each task's own."""
    return [_limit_table(comparison, name) for name in (method, OWN) if comparison.limits.get(name)]


def _limit_table(comparison: ComparisonAnswer, method: str) -> HtmlTable:
    unit = {"1": "", "V2 s": "V² s "}.get(comparison.unit, f"{comparison.unit} ")
    rows = [
        [
            cost.name,
            "differs" if cost.value is None else f"{number(cost.value)} {cost.unit}",
            cost.relax,
            f"{len(cost.tasks)} of {len(comparison.tasks_compared)} tasks" if cost.tasks else "the design",
            f"{number(cost.gain_per_unit, 3)} {unit}per {cost.unit}",
            number(cost.gain_per_percent, 3),
        ]
        for cost in comparison.limits[method][:MOST_LIMITS]
    ]
    columns = ["limit", "value", "relax", "binds in", "gain for a little more", f"gain for 1 %\n{unit.strip() or 1}"]
    return HtmlTable(f"Limits that hold it back: {method_name(method)}", columns, rows)


def result_table(tasks: TaskList, methods: Sequence[str], objective: str) -> HtmlTable:
    """What each task attains with each design, and by how much the first method misses the task's own optimum."""
    columns = ["", "task", "state", "own design", *map(method_name, methods)]
    columns += [f"regret of {method_name(methods[0])}\n%", "iterations", "solve\ns"]
    rows = [_result_row(task, methods) for task in tasks.items]
    return HtmlTable(f"Each task: {QUANTITIES[objective].replace(chr(10), ', ')}", columns, rows, left=3)


def _result_row(task: TaskResult, methods: Sequence[str]) -> list[str]:
    motions = [task.own, *(task.methods.get(method) for method in methods)]
    own, chosen = motions[0], motions[1]
    regret = None if own is None or chosen is None else chosen.objective / own.objective - 1
    values = [number(None if motion is None else motion.objective, 5) for motion in motions]
    iterations = NOTHING if task.iterations is None else str(task.iterations)
    return [str(task.index), task.name, task.state, *values, percent(regret), iterations, number(task.solve_time_s, 3)]


def certificate_table(tasks: TaskList) -> HtmlTable:
    """What an accurate integrator found of every motion."""
    columns = ["task", "design", "transcription", "replay, end\nrad", "replay, end speed\nrad/s"]
    columns += ["limits exceeded by\nshare", "KKT residual\n1", "energy balances", "tolerance kept", "inputs, SHA-256"]
    rows = [_certificate_row(task, method, motion) for task, method, motion in motions_of(tasks)]
    return HtmlTable(f"Certificates of {len(rows)} motions", columns, rows, left=3)


def motions_of(tasks: TaskList) -> Iterator[tuple[TaskResult, str, MotionResult]]:
    """Every motion that was found: a task's own first, then with each method's design."""
    for task in tasks.items:
        if task.own is not None:
            yield task, OWN, task.own
        for method, motion in task.methods.items():
            yield task, method, motion


def _certificate_row(task: TaskResult, method: str, motion: MotionResult) -> list[str]:
    found = motion.certificate
    return [
        task.name,
        "own" if method == OWN else method_name(method),
        _transcription(found),
        small(found.replay_position_rad),
        small(found.replay_speed_rad_s),
        small(found.limit_violation),
        small(found.kkt_residual),
        _balances(found),
        {True: "yes", False: "no", None: NOTHING}[found.within_tolerance],
        (found.input_hash or NOTHING)[:10],
    ]


def starts_table(tasks: TaskList) -> HtmlTable | None:
    """What several starts of each motion found; None where each had one."""
    rows = [
        [
            task.name,
            "own" if method == OWN else method_name(method),
            f"{starts.solved} of {len(starts.runs)}",
            str(starts.ends[0].starts),
            str(len(starts.ends)),
            number(starts.ends[0].objective, 5),
            number(starts.ends[-1].objective, 5),
            percent(starts.spread),
        ]
        for task, method, motion in motions_of(tasks)
        if (starts := motion.starts) is not None
    ]
    if not rows:
        return None
    columns = ["task", "design", "starts solved", "at the best", "optima", "best", "worst", "spread\n%"]
    return HtmlTable("Several starts of each motion, before any refinement of the grid", columns, rows, left=2)


def missed_tolerance(tasks: TaskList) -> str | None:
    """How many motions miss their tolerance, and whether that was to be expected; None when none does."""
    missed = [m.certificate for _, _, m in motions_of(tasks) if m.certificate.within_tolerance is False]
    if not missed or (asked := missed[0].tolerance) is None:
        return None
    text = f"{len(missed)} of the motions miss the tolerance ({number(asked.position_rad)} rad, "
    text += f"{number(asked.speed_rad_s)} rad/s, {number(asked.limit)} of each limit)"
    why = ": the transcription was asked for as it is" if all(found.as_requested for found in missed) else ""
    return f"{text}{why}."


def _transcription(found: Certificate) -> str:
    if found.scheme is None:
        return NOTHING
    return f"{found.scheme} {found.degree}, {found.intervals} intervals, {found.control}"


def _balances(found: Certificate) -> str:
    balance = found.energy_balance
    if balance is None:
        return NOTHING
    return "closed" if balance.electrical.closed and balance.mechanical.closed else "open"


def version_table(versions: Mapping[str, str]) -> HtmlTable:
    """What was installed when the application was submitted."""
    return HtmlTable("Versions", ["part", "version"], [[name, value] for name, value in versions.items()])
