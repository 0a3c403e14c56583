"""What the seven lengths of a motor are, on its cross-section  (Fig. 1)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from services.codesign.motor_data import DIMENSIONS, MotorData
from services.report.cross_section import Pen, draw_across
from services.report.section_geometry import motor_section
from services.report.style import DIMENSION_NAMES, DIMENSION_SYMBOLS, INK, QUIET

SIZE, TEXT = 4.6, 2.9  # inches
RADIUS = 2.1  # inches, of the stator
ARROW = {"arrowstyle": "<|-|>", "color": INK, "linewidth": 0.9, "mutation_scale": 7, "shrinkA": 0, "shrinkB": 0}
LEADER = {"arrowstyle": "-", "color": INK, "linewidth": 0.6, "shrinkA": 1, "shrinkB": 0}

Point = npt.NDArray[np.float64]


def dimension_key(design_mm: Sequence[float], motor: MotorData) -> Figure:
    """One motor, large, with its lengths marked and listed.

    Parameters
    ----------
    design_mm
        Shape (7,), mm, order of `DIMENSIONS`.
    motor
        Slots, pole pairs, air gap, height of the tooth tips and magnet arc.
    """
    section = motor_section(design_mm, motor)
    scale = RADIUS / section.stator_radius
    figure = Figure(figsize=(SIZE + TEXT, SIZE))  # no automatic layout: the drawing is to scale
    axes = figure.add_axes((0, 0, 1, 1), xlim=(0, SIZE + TEXT), ylim=(0, SIZE))
    axes.set_axis_off()
    centre = np.array([SIZE / 2, SIZE / 2])
    draw_across(Pen(axes, scale, *centre), section)

    def at(radius: float, angle: float, across: float = 0.0) -> Point:
        """Page's point at a radius [mm] along a direction [rad], and to the left of it [mm]."""
        along = np.array([math.cos(angle), math.sin(angle)])
        return centre + scale * (radius * along + across * np.array([-along[1], along[0]]))

    pitch = 2 * math.pi / motor.slots
    d = dict(zip(DIMENSIONS, design_mm, strict=True))
    middle = (section.slot_inner_radius + section.slot_outer_radius) / 2
    tooth, slot, gap = 3 * pitch, 0.5 * pitch, 1.5 * pitch
    _radius(axes, centre, at(section.stator_radius, -3 * pitch), DIMENSION_SYMBOLS["R_so"], 0.62)
    _radius(axes, centre, at(section.rotor_radius, -5 * pitch), DIMENSION_SYMBOLS["R_ro"], 0.55)
    _length(axes, at(middle, tooth, -d["w_tooth"] / 2), at(middle, tooth, d["w_tooth"] / 2), "w_tooth", (0, 0.14))
    _length(axes, at(section.slot_outer_radius, gap), at(section.stator_radius, gap), "h_sy", (0.16, -0.06))
    _length(axes, at(section.magnet_inner_radius, 0), at(section.rotor_radius, 0), "h_m", (-0.22, 0.1))
    tip = (section.bore_radius + section.slot_inner_radius) / 2
    _length(axes, at(tip, slot, -d["b_0"] / 2), at(tip, slot, d["b_0"] / 2), "b_0", (0.3, 0.11))
    _list(axes, d, motor)
    return figure


def _radius(axes: Axes, start: Point, end: Point, symbol: str, share: float) -> None:
    axes.annotate("", _xy(end), _xy(start), arrowprops={**ARROW, "arrowstyle": "-|>"})
    _label(axes, start + share * (end - start), symbol)


def _length(axes: Axes, start: Point, end: Point, name: str, offset: tuple[float, float]) -> None:
    axes.annotate("", _xy(end), _xy(start), arrowprops=ARROW)
    middle = (start + end) / 2
    place = middle + np.array(offset)
    axes.annotate("", _xy(middle), _xy(place), arrowprops=LEADER)
    _label(axes, place, DIMENSION_SYMBOLS[name])


def _label(axes: Axes, place: Point, symbol: str) -> None:
    box = {"facecolor": "white", "edgecolor": "none", "pad": 1.2, "alpha": 0.85}
    axes.text(*_xy(place), symbol, ha="center", va="center", fontsize=9.5, bbox=box, zorder=5)


def _xy(point: Point) -> tuple[float, float]:
    return float(point[0]), float(point[1])


def _list(axes: Axes, d: dict[str, float], motor: MotorData) -> None:
    rows = [(DIMENSION_SYMBOLS[name], DIMENSION_NAMES[name], f"{value:.4g}") for name, value in d.items()]
    rows += [
        ("", "air gap", f"{motor.air_gap * 1e3:.4g}"),
        ("", "tooth tip height", f"{motor.tooth_tip_height * 1e3:.4g}"),
    ]
    top, row = SIZE / 2 + 0.21 * len(rows) / 2, 0.21
    for k, (symbol, words, value) in enumerate(rows):
        y = top - row * k - (0.1 if k >= len(DIMENSIONS) else 0)
        axes.text(SIZE + 0.1, y, symbol, va="center_baseline", fontsize=9)
        axes.text(SIZE + 0.6, y, words, va="center_baseline", fontsize=8.5)
        axes.text(SIZE + TEXT - 0.45, y, value, va="center_baseline", ha="right", fontsize=8.5)
        axes.text(SIZE + TEXT - 0.4, y, "mm", va="center_baseline", fontsize=8.5, color=QUIET)
