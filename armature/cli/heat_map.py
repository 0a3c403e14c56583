"""Text heat maps over a grid of strokes and payloads, as in the paper's figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from rich.table import Table
from rich.text import Text

from armature.cli.layout import new_table
from shared.contracts.application import GridRequest
from shared.contracts.comparisons import ComparisonAnswer

STRONG_PERCENT = 5.0
"""From here on a cell has its full colour."""


def heat_maps(comparison: ComparisonAnswer) -> Iterator[tuple[str, Table]]:
    """How much the application's method improves on each other one, in percent, task by task; each with its title."""
    grid = comparison.grid
    methods = [name for name in comparison.methods if name != "own"]
    if grid is None or len(methods) < 2:
        return
    chosen, *others = methods
    for other in others:
        what = {"time": "time", "energy": "energy"}.get(comparison.objective, "objective")
        title = f"{chosen} against {other}: {what} saved, percent (negative: lost)"
        yield title, _heat_map(grid, _improvement(comparison, chosen, other))


def _improvement(comparison: ComparisonAnswer, chosen: str, other: str) -> dict[int, float]:
    """(other - chosen) / other in percent, by task index."""
    pairs = zip(comparison.methods[chosen].per_task, comparison.methods[other].per_task, strict=True)
    saved = [100 * (1 - ours["objective"] / theirs["objective"]) for ours, theirs in pairs]
    return dict(zip(comparison.tasks_compared, saved, strict=True))


def _heat_map(grid: GridRequest, percent: Mapping[int, float]) -> Table:
    table = new_table("stroke\nrad", *(f"{payload:g}\nkg" for payload in grid.payload_kg))
    for i, stroke in enumerate(grid.stroke):
        tasks = range(i * len(grid.payload_kg), (i + 1) * len(grid.payload_kg))
        table.add_row(f"{stroke:g}", *(_cell(percent.get(task)) for task in tasks))
    return table


def _cell(percent: float | None) -> Text:
    """Blue saves, red loses: told apart by colour-blind people, and by the sign without colour."""
    if percent is None:
        return Text("-")
    strength = min(1.0, abs(percent) / STRONG_PERCENT)
    faded = round(255 - 155 * strength)
    red, blue = (faded, 255) if percent >= 0 else (255, faded)
    return Text(f"{percent:+.1f}", style=f"black on rgb({red},{faded},{blue})")
