"""Mean and projection: Problem 2 against another optimiser from many starts, and what a projection must be."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from services.codesign.motor import constraint_limits, evaluate_motor
from services.codesign.motor_data import CONSTRAINTS, MotorData
from services.codesign.reconcile import feasible_design, mean_design, project_design, violation

MOTOR = MotorData()

FEASIBLE = 1e-8
"""Relative violation left by an interior-point solve to 1e-9."""
DISTANCE = 1e-6
"""Relative: how far the distances of two optimisers may differ at their own tolerances (1e-9 and 1e-12)."""


def constraint_margins(design: np.ndarray, motor: MotorData) -> np.ndarray:
    """Slacks of the constraints in units of their limits, all >= 0 inside; written apart from `violation`."""
    values = np.array([evaluate_motor(design, motor)[1][name] for name in CONSTRAINTS])
    low, high = constraint_limits(motor)
    return np.where(np.isfinite(high), high - values, values - low) / np.where(np.isfinite(high), high, low)


def nearest_by_sqp(target: np.ndarray, motor: MotorData, starts: int = 6) -> float:
    """Smallest relative distance that SLSQP finds from several starts."""
    rng = np.random.default_rng(0)
    bounds = list(zip(motor.lower / target, motor.upper / target, strict=True))
    first = np.clip(np.ones(7), motor.lower / target, motor.upper / target)
    begins = [first, *(feasible_design(motor) / target * rng.uniform(0.9, 1.1, 7) for _ in range(starts - 1))]
    best = np.inf
    for begin in begins:
        result = minimize(
            lambda ratio: np.sum((ratio - 1) ** 2),
            np.clip(begin, *np.array(bounds).T),
            jac=lambda ratio: 2 * (ratio - 1),
            bounds=bounds,
            constraints={"type": "ineq", "fun": lambda ratio: constraint_margins(ratio * target, motor)},
            method="SLSQP",
            options={"ftol": 1e-12, "maxiter": 500},
        )
        if constraint_margins(result.x * target, motor).min() > -FEASIBLE:
            best = min(best, float(result.fun))
    return best


def random_targets(count: int) -> np.ndarray:
    """Inside the bounds (2a), but mostly outside the constraints."""
    rng = np.random.default_rng(11)
    return rng.uniform(MOTOR.lower, np.minimum(MOTOR.upper, [0.1, 0.04, 0.06, 5e-3, 0.01, 0.02, 0.01]), (count, 7))


def test_mean_of_equal_and_unequal_weights():
    a, b = np.full((6, 7), 1.0), np.full((6, 7), 4.0)
    assert mean_design([a, b]) == pytest.approx(np.full((6, 7), 2.5))
    assert mean_design([a, b], weights=[2, 1]) == pytest.approx(np.full((6, 7), 2.0))
    assert mean_design([a, b], weights=[0, 5]) == pytest.approx(b)
    assert mean_design([a, a, b]) == pytest.approx(mean_design([a, b], weights=[2, 1]))


def test_mean_of_nothing_is_refused():
    with pytest.raises(ValueError, match="no task was solved"):
        mean_design([])


@pytest.mark.parametrize("target", random_targets(8), ids=lambda t: "-".join(f"{1e3 * x:.0f}" for x in t))
def test_projection_is_feasible_and_nearest(target):
    projection = project_design(target[None], MOTOR)
    assert projection.feasible
    assert projection.status == "Solve_Succeeded"
    design = projection.design[0]
    assert constraint_margins(design, MOTOR).min() > -FEASIBLE
    assert (design >= MOTOR.lower).all()
    assert (design <= MOTOR.upper).all()
    assert projection.distance == pytest.approx(np.sum((design / target - 1) ** 2), rel=DISTANCE, abs=1e-12)
    assert projection.distance <= nearest_by_sqp(target, MOTOR) * (1 + DISTANCE) + 1e-9


def test_the_targets_try_the_constraints():
    """The test above means something: most of its targets violate something by much."""
    assert sum(violation(target, MOTOR) > 0.05 for target in random_targets(8)) >= 6


def test_a_feasible_design_stays_as_it_is():
    design = feasible_design(MOTOR) * np.array([1.05, 1, 1.02, 1, 1, 1, 1])
    assert violation(design, MOTOR) == 0
    projection = project_design(np.tile(design, (6, 1)), MOTOR)
    assert np.array_equal(projection.design, np.tile(design, (6, 1)))
    assert projection.distance == 0


def test_motors_are_projected_one_by_one():
    targets = random_targets(3)
    together = project_design(targets, MOTOR)
    apart = [project_design(target[None], MOTOR) for target in targets]
    assert together.design == pytest.approx(np.vstack([p.design for p in apart]))
    assert together.distance == pytest.approx(sum(p.distance for p in apart))


def test_projecting_again_moves_nothing():
    once = project_design(random_targets(2), MOTOR)
    again = project_design(once.design, MOTOR)
    # 1e-4 relative: the first stops within 1e-9 of the boundary, on which the distance is flat to first order.
    assert again.design == pytest.approx(once.design, rel=1e-4)


def test_impossible_constraints_are_a_value():
    impossible = MotorData(mass_limit=0.01)
    projection = project_design(random_targets(1), impossible)
    assert not projection.feasible
    assert projection.status != "Solve_Succeeded"
    with pytest.raises(ValueError, match="no motor satisfies"):
        feasible_design(impossible)


def test_violation_measures_bounds_and_constraints():
    design = feasible_design(MOTOR)
    outside = design.copy()
    outside[4] = MOTOR.lower[4] * 0.9  # a thin yoke: 10 percent below its bound, and the flux is 1.5 / 0.9 at most
    assert violation(outside, MOTOR) >= 0.1
    free = MotorData(mass_limit=1e3)
    outside = design.copy()
    outside[0] = MOTOR.upper[0] * 1.5  # a long stack changes no constraint but the mass
    assert violation(outside, free) == pytest.approx(0.5)
    heavy = MotorData(mass_limit=evaluate_motor(design, MOTOR)[1]["mass_kg"] / 2)
    assert violation(design, heavy) == pytest.approx(1.0, rel=1e-9)  # twice the limit: over by the whole of it
