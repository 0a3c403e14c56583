"""Snapping: the nearest entry that can be built, on whatever steps are asked for."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from services.codesign.catalogue import Catalogue, CatalogueMotor, distance, snap, snap_motor
from services.codesign.motor_data import DIMENSIONS, MotorData
from services.codesign.reconcile import feasible_design, project_design, violation

MOTOR = MotorData()
STEPS = dict(zip(DIMENSIONS, np.array([5, 1, 1, 0.5, 0.5, 0.5, 0.5]) * 1e-3, strict=True))


def targets(count: int) -> np.ndarray:
    """Feasible motors here and there, at limits too."""
    generator = np.random.default_rng(0)
    return project_design(generator.uniform(MOTOR.lower, MOTOR.upper, (count, 7)), MOTOR).design


def test_every_length_is_a_multiple_of_its_step_and_the_motor_can_be_built() -> None:
    found = snap(targets(12), Catalogue(steps=STEPS), MOTOR)
    assert found is not None
    steps = np.array(list(STEPS.values()))
    for entry in found:
        np.testing.assert_allclose(entry.dimensions / steps, np.round(entry.dimensions / steps), atol=1e-9)
        assert violation(entry.dimensions, MOTOR) <= 1e-6


def test_no_motor_on_the_steps_around_is_nearer() -> None:
    """Against every combination of the two multiples around each length."""
    steps = np.array(list(STEPS.values()))
    for target in targets(3):
        found = snap_motor(target, Catalogue(steps=STEPS), MOTOR)
        around = itertools.product(
            *np.column_stack([np.floor(target / steps), np.floor(target / steps) + 1]) * steps[:, None]
        )
        feasible = [row for row in map(np.array, around) if violation(row, MOTOR) <= 1e-6]
        assert found.distance <= min(distance(row, target) for row in feasible) + 1e-12


def test_what_has_no_step_stays() -> None:
    (target,) = targets(1)
    found = snap_motor(target, Catalogue(steps={"L": 10e-3}), MOTOR)
    np.testing.assert_array_equal(found.dimensions[1:], target[1:])
    assert found.dimensions[0] % 10e-3 == pytest.approx(0, abs=1e-9) or found.dimensions[0] % 10e-3 == pytest.approx(
        10e-3
    )


def test_the_nearest_entry_that_can_be_built() -> None:
    """The nearest of all breaks a limit, and is passed over."""
    good, target = feasible_design(MOTOR), feasible_design(MOTOR) * 1.02
    entries = [
        CatalogueMotor("far", targets(1)[0]),
        CatalogueMotor("slotless", np.where(np.array(DIMENSIONS) == "R_so", 0.8, 1.0) * target),
        CatalogueMotor("near", good),
    ]
    assert violation(entries[1].dimensions, MOTOR) > 0.01
    assert snap_motor(target, Catalogue(tuple(entries)), MOTOR).name == "near"
    assert snap_motor(entries[0].dimensions, Catalogue(tuple(entries)), MOTOR).distance == 0.0


def test_a_catalogue_that_cannot_be_built_gives_nothing() -> None:
    assert snap(targets(2), Catalogue((CatalogueMotor("none", MOTOR.upper),)), MOTOR) is None
