"""What energy buys: a sweep's totals of time and energy, along alpha."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from services.codesign.comparison import OWN
from services.report.style import BLUE, ORANGE, PURPLE, QUIET, RED, light_grid, method_name, new_figure
from shared.contracts.sweeps import SweepPointResult, SweepStatus, SweepTotals

ALPHA = "objective.alpha"
LINES = ((BLUE, "o"), (ORANGE, "s"), (PURPLE, "^"), (RED, "D"))
"""Colour and marker; more combinations than these begin again."""


def has_front(sweep: SweepStatus) -> bool:
    """Whether alpha is an axis and two of its points have totals."""
    return ALPHA in sweep.axes and sum(_finished(point) is not None for point in sweep.points) > 1


def front_chart(sweep: SweepStatus) -> Figure:
    """Total energy over total time: a line along alpha for each combination of the other axes.

    Filled: with the application's method, one design for all tasks. Hollow: every task with motors of its own. Points
    whose method did not solve every task are left out, since their totals do not compare.

    Parameters
    ----------
    sweep
        `has_front`.
    """
    figure = new_figure(7.2, 4.6)
    axes = figure.subplots()
    for k, (label, points) in enumerate(_lines(sweep)):
        colour, marker = LINES[k % len(LINES)]
        method = points[0].method
        chosen = [(point, totals) for point in points if (totals := _finished(point)) is not None]
        own = [(point, totals) for point in points if (totals := _all_of(point, OWN)) is not None]
        name = ", ".join(filter(None, [method_name(method), label]))
        _line(axes, own, color=colour, marker=marker, filled=False, label=f"{method_name(OWN)}{label and ', '}{label}")
        _line(axes, chosen, color=colour, marker=marker, filled=True, label=name)
        for point, totals in chosen:
            at = (totals.time_s, totals.energy_V2s)
            text = f"α = {point.values[ALPHA]:g}" if k == 0 else ""
            axes.annotate(text, at, (6, 4), textcoords="offset points", fontsize=7.5, color=QUIET)
    axes.set_xlabel(f"total time of {sweep.points[0].tasks} tasks [s]")
    axes.set_ylabel("total energy, ∫u'u dt [V² s]")
    axes.set_title("Time against energy: the weighted objective for growing weight of energy")
    axes.set_ylim(bottom=0)
    light_grid(axes, "both")
    axes.legend()
    return figure


def _lines(sweep: SweepStatus) -> Iterator[tuple[str, list[SweepPointResult]]]:
    """Points by the values of the other axes, each line in the order of alpha."""
    others = [axis for axis in sweep.axes if axis != ALPHA]
    lines: dict[str, list[SweepPointResult]] = {}
    for point in sweep.points:
        label = ", ".join(f"{axis.rsplit('.', 1)[-1]} {point.values[axis]}" for axis in others)
        lines.setdefault(label, []).append(point)
    for label, points in lines.items():
        yield label, sorted(points, key=lambda point: float(point.values[ALPHA]))


def _line(
    axes: Axes, points: list[tuple[SweepPointResult, SweepTotals]], *, filled: bool, label: str, **look: Any
) -> None:
    face = look["color"] if filled else "none"
    if not points:
        return
    values = [(totals.time_s, totals.energy_V2s) for _, totals in points]
    style = "-" if filled else (0, (4, 3))
    axes.plot(*zip(*values, strict=True), linestyle=style, markerfacecolor=face, markersize=5, label=label, **look)


def _finished(point: SweepPointResult) -> SweepTotals | None:
    return _all_of(point, point.method)


def _all_of(point: SweepPointResult, method: str) -> SweepTotals | None:
    totals = point.totals.get(method)
    return totals if totals is not None and totals.tasks == point.tasks else None
