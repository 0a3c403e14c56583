"""Box-and-whisker charts of the tasks' own designs, one box a motor  (Fig. 6)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from services.codesign.motor_data import DIMENSIONS, MotorData
from services.report.style import (
    CHOSEN,
    DIMENSION_NAMES,
    DIMENSION_SYMBOLS,
    INK,
    OBJECTIVE_COLOURS,
    ORANGE,
    QUIET,
    RED,
    light_grid,
    method_name,
    new_figure,
    shade_outside,
)
from shared.contracts.comparisons import DesignsAnswer, SharedDesign

PAPER_DIMENSIONS = ("L", "R_so")
"""The two that the paper shows."""

PANEL_WIDTH, PANEL_HEIGHT = 3.4, 2.5  # inches
MARGIN_OF_VIEW = 0.08
"""Share of the data's range that is left free above and below."""
MOST_COLUMNS = 4
LEGEND_HANDLE, LEGEND_LETTER = 0.6, 0.07  # inches


@dataclass(frozen=True)
class MarkedDesign:
    """A design drawn over the boxes."""

    label: str
    marker: str
    colour: str
    design_mm: npt.NDArray[np.float64]  # (motors, 7)
    shift: float = 0.0  # along the axis of the motors, so that equal designs are all seen


@dataclass(frozen=True)
class _Boxes:
    """One application's boxes in every panel."""

    designs_mm: npt.NDArray[np.float64]  # (tasks, motors, 7)
    colour: str
    shift: float  # along the axis of the motors
    width: float
    marks: tuple[MarkedDesign, ...]


def design_boxes(
    designs: DesignsAnswer, method: str, motor: MotorData, dimensions: Sequence[str] = DIMENSIONS
) -> Figure:
    """Spread of the tasks' own designs, with the design chosen, the mean, and the worst case's.

    Boxes span the quartiles, the line is the median, whiskers reach the last design within 1.5 times the box; dots
    are designs beyond.

    Parameters
    ----------
    designs
        At least one task's design.
    method
        The method whose design was chosen.
    motor
        Bounds, drawn dashed where they lie in view.
    dimensions
        Those to draw, a panel each.
    """
    boxes = _Boxes(_own_designs(designs), QUIET, 0.0, 0.5, tuple(_marks(designs, method)))
    figure = _panels([boxes], motor, dimensions)
    tasks = Patch(facecolor=_pale(QUIET), edgecolor=QUIET, label=_tasks_label(designs))
    _legend(figure, [tasks, *map(_mark_handle, boxes.marks)])
    return figure


def overlaid_design_boxes(
    applications: Mapping[str, DesignsAnswer], motor: MotorData, dimensions: Sequence[str] = PAPER_DIMENSIONS
) -> Figure:
    """Two applications side by side in each panel: the paper's Fig. 6, time in red, energy in blue.

    Parameters
    ----------
    applications
        By objective: `time`, `energy` or `weighted`.
    motor
        Bounds.
    dimensions
        Those to draw, a panel each.
    """
    width = 0.7 / len(applications)
    drawn: list[_Boxes] = []
    handles: list[Line2D | Patch] = []
    for k, (objective, designs) in enumerate(applications.items()):
        colour = OBJECTIVE_COLOURS.get(objective, INK)
        worst = _shared(designs.methods.get("worst_case"))
        mark = [] if worst is None else [MarkedDesign(f"{objective}: worst case", "o", colour, worst)]
        shift = (k - (len(applications) - 1) / 2) * width
        drawn.append(_Boxes(_own_designs(designs), colour, shift, 0.8 * width, tuple(mark)))
        label = f"{objective}-optimal: {_tasks_label(designs)}"
        handles += [Patch(facecolor=_pale(colour), edgecolor=colour, label=label), *map(_mark_handle, mark)]
    figure = _panels(drawn, motor, dimensions)
    _legend(figure, handles)
    return figure


def _own_designs(designs: DesignsAnswer) -> npt.NDArray[np.float64]:
    return np.array([task.design_mm for task in designs.tasks])


def _tasks_label(designs: DesignsAnswer) -> str:
    return f"own designs of {len(designs.tasks)} tasks"


def _shared(design: SharedDesign | None) -> npt.NDArray[np.float64] | None:
    return None if design is None else np.array(design.design_mm)


def _marks(designs: DesignsAnswer, method: str) -> list[MarkedDesign]:
    """Each design once: a chosen design that is also the worst case's is drawn as the chosen one."""
    found = [
        ("mean", "_", INK, _shared(designs.mean), 0.0),
        ("empirical", "^", ORANGE, _shared(designs.methods.get("empirical")) if method != "empirical" else None, -0.17),
        ("worst case", "o", RED, _shared(designs.methods.get("worst_case")) if method != "worst_case" else None, 0.17),
        (f"chosen: {method_name(method)}", "D", CHOSEN, _shared(designs.methods.get(method)), 0.0),
    ]
    return [
        MarkedDesign(name, form, colour, rows, shift) for name, form, colour, rows, shift in found if rows is not None
    ]


def _panels(applications: Sequence[_Boxes], motor: MotorData, dimensions: Sequence[str]) -> Figure:
    columns = min(MOST_COLUMNS, len(dimensions))
    rows = -(-len(dimensions) // columns)
    figure = new_figure(PANEL_WIDTH * columns, PANEL_HEIGHT * rows + 0.4)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, name in zip(panels, dimensions, strict=False):
        index = DIMENSIONS.index(name)
        for boxes in applications:
            _draw(axes, boxes, index)
        _finish(axes, name, motor, joints=applications[0].designs_mm.shape[1])
    for axes in panels[len(dimensions) :]:
        axes.set_axis_off()
    return figure


def _draw(axes: Axes, boxes: _Boxes, index: int) -> None:
    joints = boxes.designs_mm.shape[1]
    places = np.arange(1, joints + 1) + boxes.shift
    line = {"color": boxes.colour, "linewidth": 1.0}
    axes.boxplot(
        boxes.designs_mm[:, :, index],
        positions=places,
        widths=boxes.width,
        manage_ticks=False,
        patch_artist=True,
        boxprops={"facecolor": _pale(boxes.colour), "edgecolor": boxes.colour, "linewidth": 1.0},
        medianprops={**line, "linewidth": 1.8},
        whiskerprops=line,
        capprops=line,
        flierprops={"marker": ".", "markersize": 4, "markerfacecolor": boxes.colour, "markeredgecolor": "none"},
    )
    for mark in boxes.marks:
        axes.plot(places + mark.shift, mark.design_mm[:, index], zorder=4, **_mark_style(mark))


def _mark_style(mark: MarkedDesign) -> dict[str, Any]:
    """The mean is a bar as wide as a box; others are hollow, so that what lies beneath shows."""
    size = 22 if mark.marker == "_" else 5.5
    return {
        "linestyle": "none",
        "marker": mark.marker,
        "markersize": size,
        "markerfacecolor": "none",
        "markeredgecolor": mark.colour,
        "markeredgewidth": 1.5,
    }


def _mark_handle(mark: MarkedDesign) -> Line2D:
    return Line2D([], [], label=mark.label, **_mark_style(mark))


def _finish(axes: Axes, name: str, motor: MotorData, joints: int) -> None:
    low, high = (1e3 * bound for bound in motor.bounds[name])  # mm
    bottom, top = axes.get_ylim()
    margin = max(MARGIN_OF_VIEW * (top - bottom), 0.02 * high)
    axes.set_ylim(max(bottom - margin, low - 2 * margin), min(top + margin, high + 2 * margin))
    shade_outside(axes, low, high)
    light_grid(axes)
    axes.set_xlim(0.4, joints + 0.6)
    axes.set_xticks(range(1, joints + 1))
    axes.set_xlabel("motor of joint")
    axes.set_ylabel(f"{DIMENSION_SYMBOLS[name]} [mm]")
    axes.set_title(f"{DIMENSION_NAMES[name]} (bounds {low:g} to {high:g} mm)", fontsize=9)


def _legend(figure: Figure, handles: Sequence[Line2D | Patch]) -> None:
    bound = Line2D([], [], color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)), label="bound")
    figure.legend(handles=[*handles, bound], loc="outside lower center", ncols=_columns(figure, [*handles, bound]))


def _columns(figure: Figure, handles: Sequence[Line2D | Patch]) -> int:
    """As many as the figure's width takes."""
    longest = max(len(str(handle.get_label())) for handle in handles)
    return max(1, min(len(handles), int(figure.get_figwidth() / (LEGEND_HANDLE + LEGEND_LETTER * longest))))


def _pale(colour: str) -> tuple[float, float, float]:
    """The colour mixed with white, for areas."""
    channels = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    red, green, blue = (1 - 0.28 * (1 - channel) for channel in channels)
    return red, green, blue
