"""Sections of docs/shared_optimum.md, written from what the studies stored; each function makes one."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from benchmarks.studies.records import RESULTS, read
from benchmarks.tables import table
from services.report.style import method_name

SHARED = "shared_optimum"
MOST_LIMITS = 8


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


def _slower(value: float | None, reference: float) -> str:
    return "-" if value is None else f"{100 * (value / reference - 1):.1f}"


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.4f}"


SECTIONS: Mapping[str, Callable[[], str]] = {
    "poses": poses,
    "limits": limits,
}


def sections() -> dict[str, Any]:
    """By marker, what the page has there."""
    return {name: make() for name, make in SECTIONS.items()}
