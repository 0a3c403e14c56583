"""What limits cost, against the same problem solved again with a limit changed by one percent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from services.codesign.limits import limit_slopes
from services.codesign.problem import Objective, Problem, Task, Transcription
from services.codesign.robot import Robot
from services.codesign.solution import Solution
from services.codesign.solve import solve
from services.codesign.solver import SolverOptions

UR5 = Robot.preset("ur5")
SHARP = SolverOptions(tol=1e-8)
CHANGE = 0.01

SECOND_ORDER = 0.05
"""Relative: what a central difference over one percent either way may differ by where a motion's arcs move on the grid."""

COARSE = Transcription(intervals=20)
CURRENT = Transcription("radau", 2, 12, "current")


def problem(kind: str = "time", **changes: object) -> Problem:
    task = Task(np.full(6, 0.6), np.zeros(6), 2.0, duration=0.5)
    return replace(Problem(UR5, task, objective=Objective(kind), transcription=COARSE), **changes)  # type: ignore[arg-type]


def solved(p: Problem) -> Solution:
    found = solve(p, options=SHARP)
    assert found.objective is not None
    return found


def slope(p: Problem, name: str) -> float:
    """By the multipliers."""
    found = solved(p)
    assert found.objective is not None
    assert found.lam_x is not None
    assert found.lam_g is not None
    return limit_slopes(p, found.objective, found.lam_x, found.lam_g)[name].slope


def difference(p: Problem, name: str) -> float:
    """By two more solves."""
    value, changed = LIMITS[name]
    step = CHANGE * value(p)
    high, low = (solved(changed(p, value(p) + sign * step)).objective for sign in (1, -1))
    assert high is not None
    assert low is not None
    return (high - low) / (2 * step)


def of_motor(field: str, unit: float = 1.0):
    """A limit that is a number of the motor data, in the wire's unit."""
    return (
        lambda p: getattr(p.motor, field) / unit,
        lambda p, value: replace(p, motor=replace(p.motor, **{field: value * unit})),
    )


def of_bound(name: str, end: int):
    """A bound of a length, in mm."""

    def changed(p: Problem, value: float) -> Problem:
        ends = list(p.motor.bounds[name])
        ends[end] = value * 1e-3
        return replace(p, motor=p.motor.with_bounds({name: (ends[0], ends[1])}))

    return lambda p: p.motor.bounds[name][end] * 1e3, changed


LIMITS = {
    "current_limit_A": of_motor("current_limit"),
    "voltage_limit_V": of_motor("voltage_limit"),
    "mass_limit_kg": of_motor("mass_limit"),
    "flux_density_limit_T": of_motor("flux_density_limit"),
    "wire_diameter_min_mm": of_motor("wire_diameter_min", 1e-3),
    "rotor_speed_limit_rad_s": (
        lambda p: p.robot.rotor_speed_limit,
        lambda p, value: replace(p, robot=replace(p.robot, rotor_speed_limit=value)),
    ),
    "duration_s": (
        lambda p: p.task.duration,
        lambda p, value: replace(p, task=replace(p.task, duration=value)),
    ),
    **{f"bounds_mm.{name}.{end}": of_bound(name, k) for name in ("L", "h_sy") for k, end in enumerate(("low", "high"))},
}


@pytest.mark.parametrize("name", list(LIMITS))
def test_slope_of_a_free_design_is_that_of_differences(name: str) -> None:
    p = problem("energy" if name == "duration_s" else "time")
    expected = difference(p, name)
    assert slope(p, name) == pytest.approx(expected, rel=SECOND_ORDER, abs=2e-4 * abs(solved(p).objective or 0.0))


@pytest.mark.parametrize("name", ["current_limit_A", "voltage_limit_V", "rotor_speed_limit_rad_s"])
def test_slope_of_a_motion_with_given_motors(name: str) -> None:
    """Currents linear on the intervals: voltages and speeds between the points are constraints of their own."""
    design = solved(problem()).design
    p = problem(transcription=CURRENT, design=design)
    assert slope(p, name) == pytest.approx(difference(p, name), rel=SECOND_ORDER, abs=1e-5)
