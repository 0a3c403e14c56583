"""Heat maps over strokes and payloads: how much the application's method improves on each other one  (Figs. 4, 5)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from services.codesign.comparison import OWN
from services.report.style import IMPROVEMENT, INK, OUTSIDE, QUIET, method_name, new_figure
from shared.contracts.application import GridRequest
from shared.contracts.comparisons import ComparisonAnswer
from shared.contracts.motions import TaskList, TaskResult

CELL_WIDTH, CELL_HEIGHT = 0.6, 0.42  # inches
NARROWEST, LOWEST = 3.0, 1.7  # inches: room for a title, and beside the colours for their label
FULL_COLOUR_PERCENT = 20.0
"""Colours are full from here on: the same in every figure, so that figures may be compared. The numbers go on."""
DARK_CELL = 0.53
"""Numbers are white on cells that are darker than this (relative luminance)."""


def improvement_percent(tasks: TaskList, method: str, other: str) -> dict[int, float]:
    """(other - method) / other of the objective, in percent: positive where `method` is better.

    Returns
    -------
    dict
        By index, the tasks that both methods solved.
    """
    return {
        task.index: 100 * (theirs.objective - ours.objective) / theirs.objective
        for task in tasks.items
        if (ours := task.methods.get(method)) is not None and (theirs := task.methods.get(other)) is not None
    }


def compared_methods(comparison: ComparisonAnswer, method: str) -> list[str]:
    """Methods with results beside `method`; the tasks' own designs are a bound, not a method."""
    return [name for name in comparison.methods if name not in (OWN, method)]


def improvement_maps(applications: Sequence[tuple[ComparisonAnswer, TaskList]], method: str) -> Figure:
    """One row of maps an application, one map a compared method; one colour scale for all.

    Parameters
    ----------
    applications
        Such as time- and energy-optimal over one grid.
    method
        The method that is compared with every other one.

    Raises
    ------
    ValueError
        An application has no grid, or nothing to compare with.
    """
    columns = max(len(compared_methods(comparison, method)) for comparison, _ in applications)
    if columns == 0:
        raise ValueError(f"there is no method to compare {method} with")
    grid = _grid(applications[0][0])
    figure = new_figure(
        columns * (max(NARROWEST, CELL_WIDTH * len(grid.stroke)) + 0.7) + 0.9,
        len(applications) * (max(LOWEST, CELL_HEIGHT * len(grid.payload_kg)) + 0.8),
    )
    panels = figure.subplots(len(applications), columns, squeeze=False)
    for (comparison, tasks), row in zip(applications, panels, strict=True):
        others = compared_methods(comparison, method)
        for axes, other in zip(row, others, strict=False):
            _draw(axes, _grid(comparison), tasks, method, other)
            axes.set_title(f"{comparison.objective}: {method_name(method)} against {method_name(other)}")
        for axes in row[len(others) :]:
            axes.set_axis_off()
    scale = ScalarMappable(_NORM, IMPROVEMENT)
    bar = figure.colorbar(scale, ax=panels.ravel().tolist(), extend="both", pad=0.02, aspect=28, extendfrac=0.03)
    bar.set_label(f"improvement by {method_name(method)} [%]")
    bar.outline.set_visible(False)
    return figure


_NORM = Normalize(-FULL_COLOUR_PERCENT, FULL_COLOUR_PERCENT, clip=True)


def _grid(comparison: ComparisonAnswer) -> GridRequest:
    if comparison.grid is None:
        raise ValueError("heat maps need tasks that were given as a grid of strokes and payloads")
    return comparison.grid


def _draw(axes: Axes, grid: GridRequest, tasks: TaskList, method: str, other: str) -> None:
    """Strokes to the right, payloads upwards; tasks run over payloads first."""
    percent = improvement_percent(tasks, method, other)
    shape = (len(grid.stroke), len(grid.payload_kg))
    by_index = {task.index: task for task in tasks.items}
    for index, (column, row) in enumerate(np.ndindex(*shape)):
        if index in percent:
            _cell(axes, column, row, percent[index])
        else:
            _empty_cell(axes, column, row, _who_solved(by_index.get(index), (method, other)))
    axes.set(xlim=(-0.5, shape[0] - 0.5), ylim=(-0.5, shape[1] - 0.5))
    axes.set_xticks(range(shape[0]), [f"{stroke:g}" for stroke in grid.stroke])
    axes.set_yticks(range(shape[1]), [f"{payload:g}" for payload in grid.payload_kg])
    axes.set_xlabel("stroke λ [rad]")
    axes.set_ylabel("payload [kg]")
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)


def _cell(axes: Axes, column: int, row: int, percent: float) -> None:
    colour = IMPROVEMENT(float(_NORM(percent)))
    luminance = float(np.dot(colour[:3], (0.2126, 0.7152, 0.0722)))
    _box(axes, column, row, colour)
    ink = "white" if luminance < DARK_CELL else INK
    axes.text(column, row, signed(percent), ha="center", va="center", color=ink, fontsize=8.5)


def _empty_cell(axes: Axes, column: int, row: int, text: str) -> None:
    _box(axes, column, row, OUTSIDE)
    axes.text(column, row, text, ha="center", va="center", color=QUIET, fontsize=6.5, linespacing=1.1)


def _box(axes: Axes, column: int, row: int, colour: str | tuple[float, ...]) -> None:
    axes.add_patch(Rectangle((column - 0.5, row - 0.5), 1, 1, facecolor=colour, edgecolor="white", linewidth=1.5))


def _who_solved(task: TaskResult | None, methods: tuple[str, str]) -> str:
    """Which of two methods has a motion where not both have."""
    solved: Mapping[str, object] = {} if task is None else task.methods
    found = [method_name(name) for name in methods if name in solved]
    return "only\n" + found[0] if found else "neither"


def signed(percent: float) -> str:
    """One decimal with its sign, a true minus, and no sign for what rounds to zero."""
    text = f"{percent:+.1f}"
    return "0.0" if text in ("+0.0", "-0.0") else text.replace("-", "−")
