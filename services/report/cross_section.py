"""The motors of a design, cut across and along their axes, all to one scale, with their dimensions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Polygon, Rectangle

from services.codesign.motor_data import DIMENSIONS, MotorData
from services.report.section_geometry import MotorSection, Outline, motor_section
from services.report.style import DIMENSION_NAMES, DIMENSION_SYMBOLS, INK, QUIET, method_name
from shared.contracts.comparisons import DesignAnswer

STATOR_IRON, ROTOR_IRON, COPPER, NORTH, SOUTH, AIR = "#9fabb3", "#c3cacf", "#c98745", "#b5483a", "#4a6f9c", "#ffffff"
EDGE: dict[str, Any] = {"edgecolor": INK, "linewidth": 0.4}
FINE: dict[str, Any] = {"edgecolor": INK, "linewidth": 0.2}
"""Around magnets, which may be thinner than a line."""

# The page, in inches
COLUMN, LABELS, MARGIN = 1.72, 2.0, 0.15
DRAWING = 1.56
"""Room for the widest cross-section."""
LONGEST = 2.6
"""Room for the longest stack."""
HEAD, BETWEEN, ROW, FOOT = 0.3, 0.28, 0.185, 0.2
TOLERANCE_MM = 1e-6
"""The drawing and the design sheet may differ by rounding, not by a constant."""

_SHEET_ROWS = (
    ("mass", "kg", ("stator_mass_kg", "rotor_mass_kg")),
    ("peak torque", "N m", ("torque_limit_Nm",)),
)
"""Below the dimensions: sums of a motor's parameters."""


@dataclass(frozen=True)
class Pen:
    """Draws lengths in mm on a page in inches, around a point of the page."""

    axes: Axes
    scale: float  # inches per mm
    x: float
    y: float

    def circle(self, radius: float, colour: str) -> None:
        """A disc around the point."""
        self.axes.add_patch(Circle((self.x, self.y), self.scale * radius, facecolor=colour, **EDGE))

    def outlines(self, shapes: Sequence[Outline], *colours: str, edge: dict[str, Any] = EDGE) -> None:
        """Polygons, in these colours in turn."""
        for k, shape in enumerate(shapes):
            points = self.scale * shape + np.array([self.x, self.y])
            self.axes.add_patch(Polygon(points, facecolor=colours[k % len(colours)], **edge))

    def bar(self, left: float, right: float, length: float, colour: str, edge: dict[str, Any] = EDGE) -> None:
        """A rectangle that hangs from the height of the point."""
        corner = (self.x + self.scale * left, self.y - self.scale * length)
        self.axes.add_patch(
            Rectangle(corner, self.scale * (right - left), self.scale * length, facecolor=colour, **edge)
        )


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
    scale = min(DRAWING / (2 * widest), LONGEST / longest)
    rows = [*_dimension_rows(design), *_sheet_rows(design)]

    width = LABELS + COLUMN * len(sections) + MARGIN
    height = HEAD + 2 * scale * widest + BETWEEN + scale * longest + 2 * BETWEEN + ROW * len(rows) + FOOT
    figure = Figure(figsize=(width, height))  # no automatic layout: the drawing is to scale
    axes = figure.add_axes((0, 0, 1, 1), xlim=(0, width), ylim=(0, height))
    axes.set_axis_off()
    columns = [LABELS + COLUMN * (k + 0.5) for k in range(len(sections))]
    middle = height - HEAD - scale * widest
    top = middle - scale * widest - BETWEEN
    for x, section, sheet in zip(columns, sections, design.motors, strict=True):
        axes.text(x, height - HEAD / 2, f"motor {sheet['joint']}", ha="center", va="center", fontsize=10, weight="bold")
        draw_across(Pen(axes, scale, x, middle), section)
        _along(Pen(axes, scale, x, top), section)
    axes.text(MARGIN, middle, "across the axis", va="center", color=QUIET)
    axes.text(MARGIN, top, "along the axis", va="top", color=QUIET)
    _scale_bar(axes, scale, MARGIN, middle - scale * widest)
    _table(axes, rows, columns, top - scale * longest - 1.5 * BETWEEN)
    _key(figure, design, sections[0])
    return figure


def _check_constants(design: DesignAnswer, sections: Sequence[MotorSection]) -> None:
    for sheet, section in zip(design.motors, sections, strict=True):
        stated = sheet["constraints"]["slot_height"]["value"]
        if abs(stated - section.slot_height) > TOLERANCE_MM:
            raise ValueError(
                f"motor {sheet['joint']}: slots are {stated:.6g} mm high in the design sheet, but "
                f"{section.slot_height:.6g} mm with these motor constants: they are another application's"
            )


def draw_across(pen: Pen, section: MotorSection) -> None:
    """The cross-section around the pen's point."""
    pen.circle(section.stator_radius, STATOR_IRON)
    pen.outlines(section.slots, COPPER)
    pen.outlines(section.openings, AIR)
    pen.circle(section.bore_radius, AIR)
    pen.outlines(section.magnets, NORTH, SOUTH, edge=FINE)
    pen.circle(section.magnet_inner_radius, ROTOR_IRON)
    pen.axes.plot(pen.x, pen.y, "+", color=INK, markersize=6, markeredgewidth=0.5)


def _along(pen: Pen, section: MotorSection) -> None:
    """Cut through two opposite teeth: stator, air gap, magnets, rotor; the axis runs down the page."""
    length = section.stack_length
    for side, magnet in ((-1, SOUTH), (1, NORTH)):
        pen.bar(side * section.bore_radius, side * section.stator_radius, length, STATOR_IRON)
        pen.bar(side * section.magnet_inner_radius, side * section.rotor_radius, length, magnet, FINE)
    pen.bar(-section.magnet_inner_radius, section.magnet_inner_radius, length, ROTOR_IRON)
    ends = [pen.y + 0.06, pen.y - pen.scale * length - 0.06]
    pen.axes.plot([pen.x, pen.x], ends, color=INK, linewidth=0.5, linestyle=(0, (8, 2, 1, 2)))


def _scale_bar(axes: Axes, scale: float, x: float, y: float) -> None:
    length = 50.0 if 50 * scale < LABELS / 2 else 20.0
    axes.plot([x, x + scale * length], [y, y], color=INK, linewidth=2, solid_capstyle="butt")
    axes.text(x, y + 0.05, f"{length:g} mm", va="bottom", fontsize=8)


Row = tuple[str, str, list[str]]
"""Symbol, words, and one value a motor."""


def _dimension_rows(design: DesignAnswer) -> Iterator[Row]:
    for k, name in enumerate(DIMENSIONS):
        values = [f"{row[k]:.2f}" for row in design.design_mm]
        yield DIMENSION_SYMBOLS[name], f"{DIMENSION_NAMES[name]} [mm]", values


def _sheet_rows(design: DesignAnswer) -> Iterator[Row]:
    for label, unit, names in _SHEET_ROWS:
        values = [sum(sheet["parameters"][name] for name in names) for sheet in design.motors]
        yield "", f"{label} [{unit}]", [f"{value:.2f}" for value in values]


def _table(axes: Axes, rows: Sequence[Row], columns: Sequence[float], top: float) -> None:
    for k, (symbol, words, values) in enumerate(rows):
        y = top - ROW * k
        axes.text(MARGIN, y, symbol, va="center_baseline", fontsize=8.5)
        axes.text(MARGIN + 0.45, y, words, va="center_baseline", fontsize=8)
        for x, value in zip(columns, values, strict=True):
            axes.text(x, y, value, ha="center", va="center_baseline", fontsize=8.5)
    line = top - ROW * (len(DIMENSIONS) - 0.5)
    axes.plot([MARGIN, columns[-1] + COLUMN / 2], [line, line], color=QUIET, linewidth=0.5)


def _key(figure: Figure, design: DesignAnswer, section: MotorSection) -> None:
    colours = {
        "stator iron": STATOR_IRON,
        "rotor iron": ROTOR_IRON,
        "winding": COPPER,
        "magnet, north": NORTH,
        "magnet, south": SOUTH,
    }
    handles = [Patch(facecolor=colour, label=label, **EDGE) for label, colour in colours.items()]
    figure.legend(handles=handles, loc="lower right", ncols=len(handles), borderaxespad=0.6)
    text = f"design: {method_name(design.method)};  {len(section.slots)} slots, {len(section.magnets)} poles"
    figure.text(MARGIN / figure.get_figwidth(), 0.17 / figure.get_figheight(), text, va="center", color=QUIET)
