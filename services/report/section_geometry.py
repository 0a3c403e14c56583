"""Outlines of a motor's cross-section, in mm, motor axis at the origin  (Fig. 1 and appendix, Dimensional
specifications).

From the axis outwards: rotor iron, magnets that end at R_ro, air gap, tooth tips with slot openings, teeth of constant
width with slots between them, yoke, and the stator's outer radius R_so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from services.codesign.motor_data import DIMENSIONS, MotorData

Outline = npt.NDArray[np.float64]
"""A closed polygon: shape (points, 2), mm, counter-clockwise, the first point not repeated."""

ARC_POINTS = 12
"""Points on an arc: over 30 degrees the chords leave 0.04 percent of the sector out."""

_MM = 1e3  # mm per m


@dataclass(frozen=True)
class MotorSection:
    """Radii, lengths and outlines in mm. Tooth 0 points along +x; slot k lies between teeth k and k+1."""

    stack_length: float  # L
    magnet_inner_radius: float  # R_ro - h_m
    rotor_radius: float  # R_ro, magnets included
    bore_radius: float  # R_ro + delta
    slot_inner_radius: float  # R_ro + delta + h_tip
    slot_outer_radius: float  # R_so - h_sy
    stator_radius: float  # R_so
    tooth_width: float
    slots: tuple[Outline, ...]  # what the winding fills
    openings: tuple[Outline, ...]  # through the tooth tips
    magnets: tuple[Outline, ...]  # north and south in turn

    @property
    def slot_height(self) -> float:
        """h_ss [mm]."""
        return self.slot_outer_radius - self.slot_inner_radius


def motor_section(design_mm: Sequence[float], motor: MotorData) -> MotorSection:
    """Draw a design.

    Parameters
    ----------
    design_mm
        Shape (7,), mm, order of `DIMENSIONS`.
    motor
        Slots, pole pairs, air gap, height of the tooth tips and magnet arc.

    Raises
    ------
    ValueError
        The lengths make no motor: teeth or openings overlap, or there is no room for slots or magnets.
    """
    d = dict(zip(DIMENSIONS, design_mm, strict=True))
    bore = d["R_ro"] + motor.air_gap * _MM
    slot_inner = bore + motor.tooth_tip_height * _MM
    slot_outer = d["R_so"] - d["h_sy"]
    _check(d, bore, slot_inner, slot_outer, motor)
    pitch = 2 * math.pi / motor.slots
    slot = _slot(d["w_tooth"], slot_inner, slot_outer, pitch)
    opening = _strip(d["b_0"], bore, slot_inner, pitch / 2)
    pole = math.pi / motor.pole_pairs
    arc = motor.magnet_arc / motor.pole_pairs
    magnet = _ring_sector(d["R_ro"] - d["h_m"], d["R_ro"], -arc / 2, arc / 2)
    return MotorSection(
        stack_length=d["L"],
        magnet_inner_radius=d["R_ro"] - d["h_m"],
        rotor_radius=d["R_ro"],
        bore_radius=bore,
        slot_inner_radius=slot_inner,
        slot_outer_radius=slot_outer,
        stator_radius=d["R_so"],
        tooth_width=d["w_tooth"],
        slots=tuple(_turned(slot, k * pitch) for k in range(motor.slots)),
        openings=tuple(_turned(opening, k * pitch) for k in range(motor.slots)),
        magnets=tuple(_turned(magnet, k * pole) for k in range(2 * motor.pole_pairs)),
    )


def polygon_area(outline: Outline) -> float:
    """Area [mm2], positive for counter-clockwise outlines (shoelace formula)."""
    x, y = outline.T
    return float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2


def _check(d: dict[str, float], bore: float, slot_inner: float, slot_outer: float, motor: MotorData) -> None:
    if not 0 < d["h_m"] < d["R_ro"]:
        raise ValueError(f"magnets {d['h_m']:g} mm high do not fit on a rotor of {d['R_ro']:g} mm radius")
    if not slot_inner < slot_outer:
        raise ValueError(f"no room for slots between {slot_inner:g} and {slot_outer:g} mm radius")
    width, room = math.inf, math.pi / motor.slots
    if max(d["w_tooth"], d["b_0"]) < 2 * bore:
        width = _half_angle(d["w_tooth"], bore) + _half_angle(d["b_0"], bore)
    if width > room * (1 + 1e-6):
        raise ValueError(f"tooth and slot opening need {width:.4g} rad of the {room:.4g} rad there are (2b)")


def _half_angle(width: float, radius: float) -> float:
    """Half the angle under which a strip of a width through the axis' direction cuts a circle [rad]."""
    return math.asin(width / (2 * radius))


def _slot(tooth_width: float, inner: float, outer: float, pitch: float) -> Outline:
    """Between tooth 0 and tooth 1, whose sides are parallel to their own axes."""
    low, high = _half_angle(tooth_width, inner), _half_angle(tooth_width, outer)
    return np.concatenate([_arc(outer, high, pitch - high), _arc(inner, pitch - low, low)])


def _strip(width: float, inner: float, outer: float, angle: float) -> Outline:
    """A strip of constant width along a radius, between two circles."""
    low, high = _half_angle(width, inner), _half_angle(width, outer)
    return np.concatenate([_arc(outer, angle - high, angle + high), _arc(inner, angle + low, angle - low)])


def _ring_sector(inner: float, outer: float, start: float, stop: float) -> Outline:
    return np.concatenate([_arc(outer, start, stop), _arc(inner, stop, start)])


def _arc(radius: float, start: float, stop: float) -> Outline:
    angles = np.linspace(start, stop, ARC_POINTS)
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def _turned(outline: Outline, angle: float) -> Outline:
    cosine, sine = math.cos(angle), math.sin(angle)
    turned: npt.NDArray[Any] = outline @ np.array([[cosine, sine], [-sine, cosine]])
    return turned
