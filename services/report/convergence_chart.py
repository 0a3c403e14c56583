"""How the program of all tasks converged to the best single design."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from services.report.style import CHOSEN, QUIET, light_grid, new_figure

SETTLED = 0.2
"""The first share of the iterations may be anywhere, since the program may be entered from outside its limits: it does
not set the axis."""
HEADROOM = 0.08


def convergence_chart(points: Sequence[Sequence[float]], label: str) -> Figure:
    """What the design is judged by, iteration by iteration; the dashed line is where it ended.

    Parameters
    ----------
    points
        Iteration and value, at least one.
    label
        What the value is, with its unit.
    """
    figure = new_figure(7.0, 2.6)
    axes = figure.subplots()
    iterations, values = [point[0] for point in points], [point[1] for point in points]
    axes.plot(iterations, values, color=CHOSEN)
    axes.axhline(values[-1], color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)))
    settled = values[int(SETTLED * (len(values) - 1)) :]
    low, high = min(settled), max(settled)
    room = HEADROOM * ((high - low) or abs(high) or 1.0)
    axes.set_ylim(low - room, high + room)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("iteration")
    axes.set_ylabel(label)
    light_grid(axes)
    return figure
