"""The motors of a design, cut across and along their axes, all to one scale, with their dimensions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon, Rectangle

from services.codesign.motor_data import DIMENSIONS, MotorData
from services.report.section_geometry import MotorSection, Outline, motor_section
from services.report.style import DIMENSION_NAMES, DIMENSION_SYMBOLS, INK, QUIET, method_name, new_figure
from shared.contracts.results import DesignAnswer

STATOR_IRON, ROTOR_IRON, COPPER, NORTH, SOUTH, AIR = "#9fabb3", "#c3cacf", "#c98745", "#b5483a", "#4a6f9c", "#ffffff"
EDGE: dict[str, Any] = {"edgecolor": INK, "linewidth": 0.5}

GAP = 12.0  # mm between motors
ROW = 8.5  # mm, a row of the table
LABELS = 62.0  # mm, the names of the table's rows
WIDTH = 12.0  # inches, of a figure with six motors
TOLERANCE_MM = 1e-6
"""The drawing and the design sheet may differ by rounding, not by a constant."""

_SHEET_ROWS = (
    ("mass", "kg", ("stator_mass_kg", "rotor_mass_kg")),
    ("peak torque", "N m", ("torque_limit_Nm",)),
)
"""Below the dimensions: sums of a motor's parameters."""


def motor_drawings(design: DesignAnswer, motor: MotorData) -> Figure:
    """Cross-section above, longitudinal section below, dimensions in a table, a column for each motor.

    The end windings and the shaft are not drawn: the model has no shape for them.

    Parameters
    ----------
    design
        Of n motors.
    motor
        The application's constants: slots, pole pairs, air gap, tooth tips, magnet arc.

    Raises
    ------
    ValueError
        `motor` is not what the design was made with: it gives another slot height.
    """
    sections = [motor_section(row, motor) for row in design.design_mm]
    _check_constants(design, sections)
    widest = max(section.stator_radius for section in sections)
    longest = max(section.stack_length for section in sections)
    pitch = 2 * widest + GAP
    table = _table_rows(design)

    right = pitch * len(sections) - GAP / 2
    top, bottom = widest + 16, -widest - GAP - longest - 8 - ROW * len(table)
    left = -LABELS
    inches = WIDTH / (6 * pitch + LABELS)  # per mm
    figure = new_figure((right - left) * inches, (top - bottom) * inches + 0.3)
    axes = figure.add_subplot()
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    axes.set_axis_off()
    for k, section in enumerate(sections):
        x = k * pitch + widest
        axes.text(x, widest + 6, f"motor {design.motors[k]['joint']}", ha="center", fontsize=10, weight="bold")
        _across(axes, section, x)
        _along(axes, section, x, -widest - GAP)
    axes.text(left, 0, "across the axis", va="center", color=QUIET)
    axes.text(left, -widest - GAP - longest / 2, "along the axis", va="center", color=QUIET)
    _scale_bar(axes, left, -widest - GAP - longest)
    _table(axes, table, left, [k * pitch + widest for k in range(len(sections))], -widest - GAP - longest - 12)
    keys = [("stator iron", STATOR_IRON), ("rotor iron", ROTOR_IRON), ("winding", COPPER)]
    handles = [Patch(facecolor=colour, label=label, **EDGE) for label, colour in keys]
    handles += [Patch(facecolor=c, label=f"magnet, {pole}", **EDGE) for pole, c in (("north", NORTH), ("south", SOUTH))]
    slots, poles = len(sections[0].slots), len(sections[0].magnets)
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=len(handles),
        title=f"design: {method_name(design.method)};  {slots} slots, {poles} poles;  all drawings to one scale",
        title_fontsize=9,
    )
    return figure


def _check_constants(design: DesignAnswer, sections: Sequence[MotorSection]) -> None:
    for sheet, section in zip(design.motors, sections, strict=True):
        stated = sheet["constraints"]["slot_height"]["value"]
        if abs(stated - section.slot_height) > TOLERANCE_MM:
            raise ValueError(
                f"motor {sheet['joint']}: slots are {stated:.6g} mm high in the design sheet, but "
                f"{section.slot_height:.6g} mm with these motor constants: they are another application's"
            )


def _across(axes: Axes, section: MotorSection, x: float) -> None:
    def circle(radius: float, colour: str) -> None:
        axes.add_patch(Circle((x, 0), radius, facecolor=colour, **EDGE))

    def outlines(shapes: Sequence[Outline], colours: Sequence[str]) -> None:
        for k, shape in enumerate(shapes):
            axes.add_patch(Polygon(shape + np.array([x, 0]), facecolor=colours[k % len(colours)], **EDGE))

    circle(section.stator_radius, STATOR_IRON)
    outlines(section.slots, [COPPER])
    outlines(section.openings, [AIR])
    circle(section.bore_radius, AIR)
    outlines(section.magnets, [NORTH, SOUTH])
    circle(section.magnet_inner_radius, ROTOR_IRON)
    for start, stop in (((x - 2, 0), (x + 2, 0)), ((x, -2), (x, 2))):
        axes.add_line(Line2D(*zip(start, stop, strict=True), color=INK, linewidth=0.5))


def _along(axes: Axes, section: MotorSection, x: float, top: float) -> None:
    """Cut through two opposite teeth: stator, air gap, magnets, rotor; the axis runs down the page."""
    length = section.stack_length

    def bar(inner: float, outer: float, colour: str, side: int) -> None:
        corner = (x + min(side * inner, side * outer), top - length)
        axes.add_patch(Rectangle(corner, outer - inner, length, facecolor=colour, **EDGE))

    for side in (-1, 1):
        bar(section.bore_radius, section.stator_radius, STATOR_IRON, side)
        bar(section.magnet_inner_radius, section.rotor_radius, NORTH if side > 0 else SOUTH, side)
    bar(-section.magnet_inner_radius, section.magnet_inner_radius, ROTOR_IRON, 1)
    axes.plot([x, x], [top + 3, top - length - 3], color=INK, linewidth=0.5, linestyle=(0, (8, 2, 1, 2)))


def _scale_bar(axes: Axes, x: float, y: float) -> None:
    length = 20.0
    axes.plot([x, x + length], [y, y], color=INK, linewidth=2, solid_capstyle="butt")
    axes.text(x, y + 2, f"{length:g} mm", va="bottom", fontsize=8)


def _table_rows(design: DesignAnswer) -> list[tuple[str, list[str]]]:
    rows = [
        (f"{DIMENSION_SYMBOLS[name]}  {DIMENSION_NAMES[name]} [mm]", [f"{row[k]:.2f}" for row in design.design_mm])
        for k, name in enumerate(DIMENSIONS)
    ]
    return rows + list(_sheet_rows(design))


def _sheet_rows(design: DesignAnswer) -> Iterator[tuple[str, list[str]]]:
    for label, unit, names in _SHEET_ROWS:
        values = [sum(sheet["parameters"][name] for name in names) for sheet in design.motors]
        yield f"{label} [{unit}]", [f"{value:.2f}" for value in values]


def _table(axes: Axes, rows: list[tuple[str, list[str]]], left: float, columns: list[float], top: float) -> None:
    for k, (label, values) in enumerate(rows):
        y = top - ROW * k
        axes.text(left, y, label, va="center", fontsize=8)
        for x, value in zip(columns, values, strict=True):
            axes.text(x, y, value, ha="center", va="center", fontsize=8.5)
        if k == len(DIMENSIONS):
            axes.plot([left, columns[-1] + columns[0]], [y + ROW / 2] * 2, color=QUIET, linewidth=0.5)
