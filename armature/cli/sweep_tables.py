"""A sweep's results as a table for a terminal."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rich.console import Console

from armature.cli.layout import new_table, print_table
from shared.contracts.sweeps import SweepItem, SweepPointResult, SweepStatus, SweepTotals

LONGEST_VALUE = 24
"""Characters of an axis's value: a robot inline would fill pages."""


def print_sweep(console: Console, sweep: SweepStatus, method: str | None = None) -> None:
    """Every combination of the axes' values with its totals; `method`: None for each application's own."""
    console.print(f"{sweep.name}  {sweep.id}  {sweep.state}", style="bold")
    console.print("  " + ", ".join(f"{count} {state}" for state, count in sweep.counts.items()))
    console.print()
    weighted = any(totals and totals.weighted_objective != totals.objective for totals in _totals(sweep, method))
    columns = ["objective", *(["with\nweights"] if weighted else []), "time\ns", "energy\nV2 s", "electrical\nJ"]
    axes = [axis.replace(".", ".\n") for axis in sweep.axes]
    table = new_table(*axes, "state", "solved", *columns, left=len(axes) + 1)
    for point, totals in zip(sweep.points, _totals(sweep, method), strict=True):
        values = [_short(point.values[axis]) for axis in sweep.axes]
        table.add_row(*values, point.state, *_numbers(point, totals, weighted))
    print_table(console, f"Totals over the tasks solved ({method or 'each with its own method'})", table)
    for point in sweep.points:
        if point.reason:
            console.print(f"{point.application_id}: {point.reason}", soft_wrap=True)


def print_sweeps(console: Console, items: Iterable[SweepItem]) -> None:
    """Sweeps, one a line."""
    table = new_table("id", "name", "state", "created", "axes", "applications", left=5)
    for item in items:
        created = item.created_at[:19].replace("T", " ")
        table.add_row(item.id, item.name, item.state, created, ", ".join(item.axes), str(sum(item.counts.values())))
    console.print(table if table.row_count else "no sweeps")


def _totals(sweep: SweepStatus, method: str | None) -> list[SweepTotals | None]:
    return [point.totals.get(method or point.method) for point in sweep.points]


def _numbers(point: SweepPointResult, totals: SweepTotals | None, weighted: bool) -> list[str]:
    if totals is None:
        return [f"0 of {point.tasks}", *["-"] * (5 if weighted else 4)]
    unit = "" if point.unit == "1" else f" {point.unit}"
    return [
        f"{totals.tasks} of {point.tasks}",
        f"{totals.objective:.4f}{unit}",
        *([f"{totals.weighted_objective:.4f}{unit}"] if weighted else []),
        f"{totals.time_s:.4f}",
        f"{totals.energy_V2s:.1f}",
        f"{totals.electrical_energy_J:.1f}",
    ]


def _short(value: Any) -> str:
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE - 3]}..."
