"""The drawn cross-section against the design, the reference motors and areas in closed form."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from services.codesign.motor_data import MotorData
from services.report.section_geometry import motor_section, polygon_area
from tests.report.answers import SMALL_MM, TABLE_I_MM

SAMPLES = json.loads((Path(__file__).parents[1] / "data" / "motors.json").read_text())["samples"]
MOTOR = MotorData()

CHORDS = 1e-3
"""Relative; arcs are drawn as 11 chords, which leave at most 4e-4 of a sector out (twice that for a ring of one)."""
TOOTH_ENDS = 0.01
"""Relative; the model takes h_ss for a tooth's whole length, while its sides are longer than its middle:
the slot as drawn is smaller by w^3 / 24 (1/r_inner - 1/r_outer), 0.5 percent for Table I's motor."""
DRAWN = 1e-12
"""Relative; points are computed from the lengths by sines and cosines."""


@pytest.mark.parametrize("design_mm", [TABLE_I_MM, SMALL_MM])
def test_radii_and_widths_are_the_designs(design_mm: list[float]) -> None:
    L, R_ro, R_so, h_m, h_sy, w_tooth, b_0 = design_mm
    section = motor_section(design_mm, MOTOR)
    assert section.stack_length == L
    assert section.stator_radius == R_so
    assert section.bore_radius == pytest.approx(R_ro + 0.5, rel=DRAWN)
    for magnet in section.magnets:
        radii = np.hypot(*magnet.T)
        assert [radii.min(), radii.max()] == pytest.approx([R_ro - h_m, R_ro], rel=DRAWN)
    for slot in section.slots:
        radii = np.hypot(*slot.T)
        assert [radii.min(), radii.max()] == pytest.approx([R_ro + 2.5, R_so - h_sy], rel=DRAWN)
    # Tooth 0 lies along +x, between the first slot and the last: its sides are parallel, w_tooth apart.
    sides = [section.slots[0][:, 1].min(), -section.slots[-1][:, 1].max()]
    assert sides == pytest.approx([w_tooth / 2, w_tooth / 2], rel=DRAWN)
    opening = section.openings[0]
    across = np.array([-math.sin(math.pi / 12), math.cos(math.pi / 12)])  # to the first slot's own axis
    assert np.ptp(opening @ across) == pytest.approx(b_0, rel=DRAWN)


def test_there_are_as_many_slots_and_magnets_as_the_motor_has() -> None:
    section = motor_section(TABLE_I_MM, MOTOR)
    assert (len(section.slots), len(section.openings), len(section.magnets)) == (12, 12, 8)
    other = motor_section(TABLE_I_MM, MotorData(slots=9, pole_pairs=4))
    assert (len(other.slots), len(other.openings), len(other.magnets)) == (9, 9, 8)


def test_slots_are_one_another_turned_and_do_not_overlap() -> None:
    section = motor_section(TABLE_I_MM, MOTOR)
    middles = [math.atan2(*slot.mean(axis=0)[::-1]) % (2 * math.pi) for slot in section.slots]
    assert middles == pytest.approx([(k + 0.5) * math.pi / 6 for k in range(12)], rel=DRAWN)
    angles = np.arctan2(section.slots[0][:, 1], section.slots[0][:, 0])
    assert angles.min() > 0
    assert angles.max() < math.pi / 6


@pytest.mark.parametrize("sample", SAMPLES, ids=range(len(SAMPLES)))
def test_slot_area_is_the_reference_motors(sample: dict[str, Any]) -> None:
    """The reference states a turn's copper, half a slot's over the turns: A_slot = 2 n_s A_coil / f_f.

    A reference motor whose teeth and openings overlap, residual above 0, cannot be drawn.
    """
    if sample["constraint_residuals"]["tooth_width_rad"] > 0:
        with pytest.raises(ValueError, match="2b"):
            motor_section(sample["design_mm"], MOTOR)
        return
    area = 2 * sample["turns_per_tooth"] * sample["coil_area_m2"] * 1e6 / 0.55  # mm2
    drawn = polygon_area(motor_section(sample["design_mm"], MOTOR).slots[0])
    assert drawn < area
    assert drawn == pytest.approx(area, rel=TOOTH_ENDS)


@pytest.mark.parametrize("design_mm", [TABLE_I_MM, SMALL_MM])
def test_areas_are_those_in_closed_form(design_mm: list[float]) -> None:
    _, R_ro, R_so, h_m, h_sy, w_tooth, b_0 = design_mm
    bore, inner, outer = R_ro + 0.5, R_ro + 2.5, R_so - h_sy
    section = motor_section(design_mm, MOTOR)
    tooth = _strip(w_tooth, outer) - _strip(w_tooth, inner)
    slot = math.pi * (outer**2 - inner**2) / 12 - tooth
    assert polygon_area(section.slots[0]) == pytest.approx(slot, rel=CHORDS)
    opening = _strip(b_0, inner) - _strip(b_0, bore)
    assert polygon_area(section.openings[0]) == pytest.approx(opening, rel=CHORDS)
    magnet = math.pi * (R_ro**2 - (R_ro - h_m) ** 2) / 8
    assert polygon_area(section.magnets[0]) == pytest.approx(magnet, rel=CHORDS)


def _strip(width: float, radius: float) -> float:
    """Area between a strip's axis and a circle: the integral of sqrt(r2 - x2) over the width."""
    half = width / 2
    return half * math.sqrt(radius**2 - half**2) + radius**2 * math.asin(half / radius)


@pytest.mark.parametrize(
    ("name", "value", "word"), [("w_tooth", 20.0, "2b"), ("h_m", 18.0, "magnets"), ("R_so", 25.4, "slots")]
)
def test_lengths_that_make_no_motor_are_refused(name: str, value: float, word: str) -> None:
    index = ["L", "R_ro", "R_so", "h_m", "h_sy", "w_tooth", "b_0"].index(name)
    design_mm = [*TABLE_I_MM[:index], value, *TABLE_I_MM[index + 1 :]]
    with pytest.raises(ValueError, match=word):
        motor_section(design_mm, MOTOR)
