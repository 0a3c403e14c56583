"""Results as tables for a terminal. Every number has its unit in its column or beside it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from armature.cli.heat_map import heat_maps
from armature.cli.layout import new_table, print_table
from armature.cli.reference import Reference
from armature.progress import done, time_left
from shared.contracts.comparisons import ComparisonAnswer, DesignAnswer, DesignsAnswer
from shared.contracts.motions import MotionResult, TaskResult
from shared.contracts.states import ApplicationItem, ApplicationStatus

OWN = "own"
MOST_LIMITS = 10
ALIKE = 0.01
"""Difference to a reference total above which it is explained."""

QUANTITIES = {
    "time": "final time, s",
    "energy": "energy, V2 s",
    "weighted": "weighted sum of time and energy",
    "electrical_energy": "electrical energy, J",
}
"""What is minimised, by the objective's kind."""

REGRET = (
    "regret: how much worse than giving each task motors of its own ('own'), a bound that no single design can beat."
)

JUDGED = "judged by: what the design is for, the objective over the tasks with their weights (objective.over_tasks)."
SAME = 1e-9
"""Relative difference of two figures that are the same but for the order of additions."""
SHOWN_PERCENT = 0.005
"""A difference that rounds to 0.00 percent is none: solves end within their tolerance."""


STARTS = "Spread: how far the worst optimum that a start of the own design found lies above the best one."


def print_status(console: Console, status: ApplicationStatus) -> None:
    """An application in a few lines."""
    console.print(f"{status.name}  {status.id}  {status.state}", style="bold")
    if status.reason:
        console.print(f"  {status.reason}")
    tasks = "1 task" if status.tasks == 1 else f"{status.tasks} tasks"
    console.print(f"  {tasks}, {status.objective.kind}, {', '.join(status.methods)}, robot {status.robot}")
    for stage in status.progress.stages:
        failed = f", {stage.failed + stage.dead} failed" if stage.failed + stage.dead else ""
        running = f", {stage.running} running" if stage.running else ""
        console.print(f"  {stage.name:<10} {done(stage):>4} of {stage.total}{running}{failed}")
    if status.finished_at is None and (left := time_left(status.progress)):
        console.print(f"  {left}")
    times = status.timings
    if times.wall_time_s is not None and status.finished_at is not None:
        console.print(f"  {times.wall_time_s:.1f} s on the clock, {times.solver_time_s:.1f} s in the solver")


def print_list(console: Console, items: Iterable[ApplicationItem]) -> None:
    """Applications, one a line."""
    table = new_table("id", "name", "state", "created", "tags", left=5)
    for item in items:
        table.add_row(item.id, item.name, item.state, item.created_at[:19].replace("T", " "), " ".join(item.tags))
    console.print(table if table.row_count else "no applications")


def print_design(console: Console, design: DesignAnswer) -> None:
    """Dimensions and main parameters of every motor, then what binds."""
    dimensions = list(design.motors[0]["dimensions_mm"])
    columns = [f"{name}\nmm" for name in dimensions]
    table = new_table("joint", *columns, "flux\nWb", "resist.\nohm", "mass\nkg")
    for motor in design.motors:
        values = motor["dimensions_mm"]
        parameters = motor["parameters"]
        mass = parameters["stator_mass_kg"] + parameters["rotor_mass_kg"]
        table.add_row(
            str(motor["joint"]),
            *(f"{values[name]:.2f}" for name in dimensions),
            f"{parameters['flux_linkage_Wb']:.4f}",
            f"{parameters['phase_resistance_ohm']:.3f}",
            f"{mass:.3f}",
        )
    print_table(console, f"Design ({design.method})", table)
    console.print("\nWhat binds:")
    alike: dict[str, list[str]] = {}
    for motor in design.motors:
        names = ", ".join(_binding(motor, name) for name in motor["binding"]) or "nothing"
        alike.setdefault(names, []).append(str(motor["joint"]))
    for names, joints in alike.items():
        console.print(f"  joint{'s' if len(joints) > 1 else ''} {', '.join(joints)}: {names}", soft_wrap=True)


def _binding(motor: Mapping[str, Any], name: str) -> str:
    """A limit's name, with the value it holds the design at."""
    constraint = motor["constraints"].get(name)
    if constraint is None:
        return name
    return f"{name} = {constraint['limit']:.4g} {constraint['unit']}"


def print_designs(console: Console, designs: DesignsAnswer) -> None:
    """How far the tasks' own designs lie apart, then each method's design."""
    count = len(designs.tasks)
    if count:
        table = new_table("joint", *designs.dimensions)
        for joint, of_motor in enumerate(zip(*(task.design_mm for task in designs.tasks), strict=True)):
            ranges = [_range(values) for values in zip(*of_motor, strict=True)]
            table.add_row(str(joint + 1), *ranges)
        print_table(console, f"Own designs of {count} tasks, lowest to highest, mm", table)
    shared = {"mean of the own designs": designs.mean, **designs.methods}
    for name, design in shared.items():
        if design is None:
            continue
        gears = design.gear_ratio
        table = new_table("joint", *designs.dimensions, *([] if gears is None else ["gear"]))
        for joint, values in enumerate(design.design_mm):
            gear = [] if gears is None else [f"{gears[joint]:.1f}"]
            table.add_row(str(joint + 1), *(f"{value:.2f}" for value in values), *gear)
        console.print()
        stopped = " (search stopped by request)" if design.stopped else ""
        print_table(console, f"{name}, mm{stopped}", table)


def _range(values: Sequence[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:.1f}" if high - low < 0.05 else f"{low:.1f}-{high:.1f}"


def print_tasks(console: Console, tasks: Sequence[TaskResult], methods: Sequence[str], objective: str) -> None:
    """One line a task: its own optimum and its motion with each design, in the objective's unit."""
    several = any(task.own is not None and task.own.starts is not None for task in tasks)
    of_starts = ["starts at\nthe best", "spread\n%"] if several else []
    table = new_table("", "task", "state", OWN, *methods, "iterations", "solve\ns", *of_starts, left=3)
    for task in tasks:
        motions = [task.own, *(task.methods.get(method) for method in methods)]
        table.add_row(
            str(task.index),
            task.name,
            task.state,
            *("-" if motion is None else f"{motion.objective:.4f}" for motion in motions),
            "-" if task.iterations is None else str(task.iterations),
            "-" if task.solve_time_s is None else f"{task.solve_time_s:.2f}",
            *(_starts(task.own) if several else []),
        )
    print_table(console, f"Tasks: {QUANTITIES[objective]}", table)
    if several:
        console.print(STARTS, soft_wrap=True)


def _starts(own: MotionResult | None) -> list[str]:
    """How many of a co-design's starts ended at its best optimum, and how far above it the worst of them did."""
    if own is None or own.starts is None:
        return ["-", "-"]
    starts = own.starts
    return [f"{starts.ends[0].starts} of {len(starts.runs)}", f"{100 * starts.spread:.2f}"]


def print_failures(console: Console, tasks: Iterable[TaskResult], methods: Sequence[str]) -> None:
    """Solves that failed, and why."""
    failed = [task for task in tasks if task.state in ("failed", "dead")]
    if not failed:
        return
    console.print("Failed solves:")
    for task in failed:
        without = [method for method in methods if method not in task.methods]
        what = "no motion at all, left out of the design" if task.own is None else f"with {', '.join(without)}"
        console.print(f"  task {task.index}, {task.name}, {what}: {task.reason}", soft_wrap=True)
    console.print()


def print_comparison(console: Console, comparison: ComparisonAnswer, reference: Reference | None = None) -> None:
    """Totals and regret of every method, beside the reference's; then heat maps of a grid."""
    if not comparison.tasks_compared:
        console.print("There is no task that every method solved: nothing to compare.")
        return
    if reference is not None and not reference.totals:
        reference = None
    names = comparison.task_names
    title = f"Totals over the {len(names)} tasks that every method solved" if len(names) > 1 else f"Task '{names[0]}'"
    print_table(console, title, _totals(comparison, reference))
    for name, why in comparison.missing.items():
        console.print(f"{name}: {why}")
    for line in [REGRET, *_verdict(comparison), *_explanations(comparison, reference)]:
        console.print(line, soft_wrap=True)
    for title, heat_map in heat_maps(comparison):
        console.print()
        print_table(console, title, heat_map)
    _print_scattered(console, comparison)
    _print_limits(console, comparison)


def _print_scattered(console: Console, comparison: ComparisonAnswer) -> None:
    """Each task as given, over its samples."""
    if not comparison.scattered:
        return
    names = list(comparison.methods)
    table = new_table("task", "samples", *names)
    for task in comparison.scattered:
        spreads = [task.methods[name] for name in names]
        cells = [f"{s.mean:.4f} ± {s.standard_deviation:.4f}, ≤ {s.largest:.4f}" for s in spreads]
        table.add_row(task.name, str(task.samples), *cells)
    console.print()
    print_table(console, f"Over the samples: {QUANTITIES[comparison.objective]}", table)


def _print_limits(console: Console, comparison: ComparisonAnswer) -> None:
    """What binds with the application's own design, and with motors of each task's own."""
    chosen = next((name for name in comparison.methods if name != OWN), OWN)
    for name in dict.fromkeys([chosen, OWN]):
        costs = comparison.limits.get(name, [])[:MOST_LIMITS]
        if not costs:
            continue
        unit = f"{comparison.unit} " if comparison.unit != "1" else ""
        table = new_table("limit", "value", "", "relax", "binds in", f"gain, {unit}per", "", "for 1 %", left=1)
        for cost in costs:
            tasks = f"{len(cost.tasks)} of {len(comparison.tasks_compared)}" if cost.tasks else "the design"
            table.add_row(
                cost.name,
                "differs" if cost.value is None else f"{cost.value:.4g}",
                cost.unit,
                cost.relax,
                tasks,
                f"{cost.gain_per_unit:.3g}",
                cost.unit,
                f"{cost.gain_per_percent:.3g}",
            )
        console.print()
        print_table(console, f"Limits that hold it back, and what a little more of each would bring ({name})", table)


def _totals(comparison: ComparisonAnswer, reference: Reference | None) -> Table:
    weighted = comparison.unit == "1"
    judged = comparison.judged if _is_judged_apart(comparison) else {}
    columns = ["method", *(["weighted sum"] if weighted else [])]
    columns += [f"judged by\n{comparison.unit}" if comparison.unit != "1" else "judged by"] if judged else []
    columns += ["time\ns", "energy\nV2 s", "electrical\nJ", "copper\nJ", "regret\n%"]
    columns += [] if reference is None else [f"reference\n{comparison.unit}", "differs\n%"]
    table = new_table(*columns)
    for name, method in comparison.methods.items():
        regret = comparison.regret.get(name)
        row = [name, *([f"{method.total_objective:.4f}"] if weighted else [])]
        row += [f"{judged[name]:.4f}"] if judged else []
        row += [f"{method.total_time_s:.4f}", f"{method.total_energy_V2s:.1f}"]
        row += [f"{method.total_electrical_energy_J:.1f}", f"{method.total_copper_loss_J:.1f}"]
        row += ["-" if regret is None or regret.total is None else f"{100 * regret.total:.2f}"]
        if reference is not None:
            row += _beside(method.total_objective, reference.totals.get(name))
        table.add_row(*row)
    return table


def _beside(found: float, expected: float | None) -> list[str]:
    """A reference value, and the difference to it in percent."""
    return ["-", "-"] if expected is None else [f"{expected:.4f}", f"{100 * (found / expected - 1):+.2f}"]


def print_reference_tasks(console: Console, reference: Reference, tasks: Iterable[TaskResult]) -> None:
    """Single optima beside the reference's."""
    by_name = {task.name: task.own for task in tasks if task.own is not None}
    rows = [(name, value, by_name[name]) for name, value in reference.tasks.items() if name in by_name]
    if not rows:
        return
    unit = reference.unit
    table = new_table("own optimum of task", f"found\n{unit}", f"reference\n{unit}", "differs\n%")
    for name, expected, motion in rows:
        table.add_row(name, f"{motion.objective:.4f}", *_beside(motion.objective, expected))
    print_table(console, "Single tasks", table)


def _is_judged_apart(comparison: ComparisonAnswer) -> bool:
    """Whether weights or the worst task make what a design is judged by another figure than the plain total."""
    return any(
        abs(value - comparison.methods[name].total_objective) > SAME * abs(value)
        for name, value in comparison.judged.items()
    )


def _verdict(comparison: ComparisonAnswer) -> list[str]:
    """When another method beats the application's own, by what a design is for, that is said."""
    totals = {name: method.total_objective for name, method in comparison.methods.items()}
    judged = {name: value for name, value in (comparison.judged or totals).items() if name != OWN}
    lines = [JUDGED] if _is_judged_apart(comparison) else []
    if len(judged) < 2:
        return lines
    chosen, best = next(iter(judged)), min(judged, key=lambda name: judged[name])
    percent = 100 * (judged[chosen] - judged[best]) / abs(judged[best]) if judged[best] else 0.0
    if percent < SHOWN_PERCENT:
        return lines
    what = "what it is judged by" if lines else "the total"
    undone = len(set(comparison.unsolved.get(best, [])) - set(comparison.unsolved.get(chosen, [])))
    but = f" But {best} has no motion for {undone} task{'s' * (undone > 1)} that {chosen} does." if undone else ""
    return [
        *lines,
        f"{best} does better than {chosen} here: with {chosen} {what} is {percent:.2f} percent higher.{but}",
    ]


def _explanations(comparison: ComparisonAnswer, reference: Reference | None) -> list[str]:
    """Why totals differ from the reference, where they differ by more than rounding."""
    if reference is None:
        return []
    lines = []
    for name in comparison.methods:
        expected = reference.totals.get(name)
        if expected is None or abs(comparison.methods[name].total_objective / expected - 1) <= ALIKE:
            continue
        why = reference.explanations.get(
            name, "no explanation is known; the tasks' own optima tell which solves differ"
        )
        lines.append(f"{name} differs from the reference by more than {100 * ALIKE:g} percent: {why}")
    return lines
