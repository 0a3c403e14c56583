"""Sections of docs/shared_optimum.md, written from what the studies stored; each function makes one."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from benchmarks.studies.records import RESULTS, Record, read, stored_sweep
from benchmarks.studies.sweeps import SWEEPS
from benchmarks.tables import table
from services.report.style import method_name
from shared.contracts.sweeps import SweepPointResult, SweepStatus

SHARED = "shared_optimum"
MOST_LIMITS = 8


def paper() -> str:
    """Totals over the paper's 25 tasks, and in how many tasks the shared optimum is better."""
    record = read("paper")["time"]
    ours, reference = record.objectives[SHARED], record.judged(SHARED)
    assert reference is not None
    rows = []
    for name, values in sorted(record.objectives.items(), key=lambda item: record.judged(item[0]) or np.inf):
        total = record.judged(name)
        better = sum(mine is not None and (its is None or mine < its) for mine, its in zip(ours, values, strict=True))
        against = "-" if total is None else f"{100 * (total / reference - 1):+.2f}"
        faster = "-" if name == SHARED else f"{better} of {len(values)}"
        rows.append([method_name(name), _figure(total), against, faster])
    head = ["design", "total time, s", "against the shared optimum, %", "tasks that the shared optimum does faster"]
    return table(head, rows)


def poses() -> str:
    """Every method on the twelve unlike poses, and the best of all single designs."""
    record = read("twelve_poses")["time"]
    values: dict[str, float | None] = {method_name(name): record.judged(name) for name in record.objectives}
    values["best of the twelve own designs"] = best_single_design()
    reference = record.judged(SHARED)
    assert reference is not None
    rows = [
        [name, _figure(value), "-" if value is None else f"{100 * (value / reference - 1):+.2f}"]
        for name, value in sorted(values.items(), key=lambda item: item[1] or np.inf)
    ]
    least = 100 * largest_regrets().min()
    single, worst_case, two_step = (
        _slower(value, reference)
        for value in (best_single_design(), record.judged("worst_case"), record.judged("two_step"))
    )
    said = (
        f"Against the shared optimum the best of the twelve own designs is {single} percent slower, the worst case's "
        f"{worst_case}, the two-step's {two_step}. With every own design some other task takes at least {least:.1f} "
        "percent longer than with motors of its own."
    )
    return table(["design", "total time, s", "against the shared optimum, %"], rows) + "\n\n" + said


def single_designs() -> np.ndarray:
    """Times [s] on the twelve poses: a row a task's own design, a column a task, NaN without a motion."""
    stored = json.loads((RESULTS / "twelve_poses_designs.json").read_bytes())
    return np.array(stored["times_s"], dtype=float)


def best_single_design() -> float:
    """Smallest total [s] of any one task's own design that does every task."""
    return float(np.nanmin(single_designs().sum(axis=1)))


def largest_regrets() -> np.ndarray:
    """For each task's own design, how much longer than with motors of its own another task takes, at worst."""
    times = single_designs()
    worst: np.ndarray = np.nanmax(times / np.diag(times) - 1, axis=1)
    return worst


def applications() -> str:
    """A row an application: what each method is judged by over all tasks, or how many it has no motion for."""
    records = read("twelve_applications")
    methods = ["own", SHARED, "two_step", "empirical", "worst_case"]
    rows = []
    for name, record in records.items():
        margin = margin_percent(record)
        shown = [_judged(record, method) for method in methods]
        rows.append([name, record.comparison.unit, *shown, "-" if margin is None else f"{margin:.2g}"])
    margins = [margin for record in records.values() if (margin := margin_percent(record)) is not None]
    said = (
        f"In none of the {len(records)} a method that does every task is better than the shared optimum. "
        f"The best of these is worse by {min(margins):.2g} to {max(margins):.1f} percent."
    )
    return table(["application", "unit", *map(method_name, methods), "margin over the next, %"], rows) + "\n\n" + said


def margin_percent(record: Record) -> float | None:
    """How much worse the best other method is that does every task; None when none does."""
    ours = record.judged(SHARED)
    others = [record.judged(m) for m in record.objectives if m not in ("own", SHARED)]
    known = [value for value in others if value is not None]
    return None if ours is None or not known else 100 * (min(known) - ours) / abs(ours)


def worst_task() -> str:
    """The sum's optimum, the mix's and the worst task's on the same tasks."""
    records, rows = read("worst_task"), []
    for name, record in records.items():
        found = record.comparison.methods[SHARED]
        deciding = record.designs.methods[SHARED].deciding_tasks or []
        rows.append(
            [
                name,
                f"{found.weighted_objective:.4f}",
                f"{found.worst_objective:.4f}",
                ", ".join(f"{task.name}: {100 * task.share:.0f} %" for task in deciding) or "-",
            ]
        )
    by_sum, by_worst = (records[kind].comparison.methods[SHARED] for kind in ("sum", "worst"))
    said = (
        f"Judged by the worst task, that task takes {_percent_less(by_worst.worst_objective, by_sum.worst_objective)} "
        f"percent less than with the sum's design, and the weighted sum rises by "
        f"{_slower(by_worst.weighted_objective, by_sum.weighted_objective)} percent."
    )
    return table(["judged by", "weighted sum, s", "worst task, s", "tasks that decide"], rows) + "\n\n" + said


def front() -> str:
    """Totals along alpha."""
    head = ["alpha", "time, s", "energy, V² s", "electrical energy, J", "own designs: time, s", "energy, V² s"]
    return table(head, [_front_row(point) for point in _sweep("front").points])


def _front_row(point: SweepPointResult) -> list[str]:
    ours, own = point.totals[SHARED], point.totals["own"]
    return [
        f"{point.values['objective.alpha']:g}",
        f"{ours.time_s:.4f}",
        f"{ours.energy_V2s:.0f}",
        f"{ours.electrical_energy_J:.1f}",
        f"{own.time_s:.4f}",
        f"{own.energy_V2s:.0f}",
    ]


def gears() -> str:
    """Totals of each method for fixed gear ratios."""
    methods = ["own", SHARED, "two_step"]
    rows = []
    for point in _sweep("gears").points:
        times = [f"{found.objective:.4f}" if (found := point.totals.get(m)) else "-" for m in methods]
        rows.append([f"{point.values['robot_changes.gear_ratio']:g}:1", *times])
    return table(["gear ratio", *(f"{method_name(m)}, s" for m in methods)], rows)


def limits() -> str:
    """What relaxing each limit would bring, with the shared optimum of the twelve poses."""
    record = read("twelve_poses")["time"]
    rows = []
    for cost in record.comparison.limits[SHARED][:MOST_LIMITS]:
        value = "differs" if cost.value is None else f"{cost.value:.4g} {cost.unit}"
        where = f"{len(cost.tasks)} of {len(record.weights)} tasks" if cost.tasks else "the design"
        unit = f"s/({cost.unit})" if "/" in cost.unit else f"s/{cost.unit}"
        gain = f"{cost.gain_per_unit:.3g} {unit}"
        rows.append([f"`{cost.name}`", value, cost.relax, where, gain, f"{1e3 * cost.gain_per_percent:.2f}"])
    return table(["limit", "value", "relax", "binds in", "gain", "for 1 %, ms"], rows)


def _sweep(study: str) -> SweepStatus:
    found = stored_sweep(study, SWEEPS[study])
    assert found is not None, f"benchmarks/results/{study}.json is not of the sweep that the study asks for"
    return found


def _percent_less(value: float, reference: float) -> str:
    return f"{100 * (1 - value / reference):.1f}"


def _slower(value: float | None, reference: float) -> str:
    return "-" if value is None else f"{100 * (value / reference - 1):.1f}"


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.4f}"


def _judged(record: Record, method: str) -> str:
    """A figure, or how many tasks have no motion."""
    undone = record.undone(method)
    if undone:
        return f"{undone} of {len(record.weights)} undone"
    return f"{record.judged(method):.6g}"


def cost() -> str:
    """Seconds of the two-step and of the shared optimum in one run, and what each design gives."""
    head = ["tasks", "objective", "two-step s", "shared s", "ratio", "iterations", "KKT", "shared total", "two-step"]
    stored = json.loads((RESULTS / "shared_optimum.json").read_bytes())
    return table([*head, "empirical", "largest process, MB"], map(_cost_row, stored.values()))


def _cost_row(run: Mapping[str, Any]) -> list[str]:
    totals, unit = run["totals"], {"1": ""}.get(run["unit"], f" {run['unit'].replace('V2', 'V²')}")
    kind, left_out = run["objective"]["kind"], run["tasks"] - run["tasks_compared"]
    memory = run.get("largest_process_mb")
    return [
        str(run["tasks"]),
        f"{kind}; over the {run['tasks_compared']} tasks that every design can do" if left_out else kind,
        *(f"{run[name]:.3g}" for name in ("two_step_s", "shared_s", "ratio")),
        str(run["iterations"]),
        f"{run['kkt_residual']:.1e}",
        *(f"{totals[method]:.5g}{unit}" for method in (SHARED, "two_step", "empirical")),
        "-" if memory is None else f"{memory:.0f}",
    ]


SECTIONS: Mapping[str, Callable[[], str]] = {
    "paper": paper,
    "poses": poses,
    "applications": applications,
    "worst task": worst_task,
    "front": front,
    "gears": gears,
    "limits": limits,
    "cost": cost,
}


def sections() -> dict[str, Any]:
    """By marker, what the page has there."""
    return {name: make() for name, make in SECTIONS.items()}
