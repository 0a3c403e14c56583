"""What limits cost, against the same problem solved again with a limit changed by one percent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from services.codesign.limits import binding, limit_slopes, unit_of
from services.codesign.problem import Objective, Problem, Task, Transcription
from services.codesign.robot import Robot
from services.codesign.shared_optimum import SharedOptimum, SharedStart, solve_shared
from services.codesign.solution import Solution
from services.codesign.solve import solve
from services.codesign.solver import SolverOptions

UR5 = Robot.preset("ur5")
SHARP = SolverOptions(tol=1e-8)
CHANGE = 0.01

SECOND_ORDER = 0.05
"""Relative: what a difference over one percent either way may be off by, where a motion's arcs move on the grid."""

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
    assert found.lam_x is not None
    assert found.lam_g is not None
    return limit_slopes(p, found.lam_x, found.lam_g)[name].slope


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


def of_joint(field: str, k: int):
    """A limit of one joint."""

    def changed(p: Problem, value: float) -> Problem:
        return replace(p, robot=replace(p.robot, **{field: _with(getattr(p.robot, field), k, value)}))

    return lambda p: getattr(p.robot, field)[k], changed


def _with(values: np.ndarray, k: int, value: float) -> np.ndarray:
    return np.where(np.arange(len(values)) == k, value, values)


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
    "joint_speed_limit_rad_s.2": of_joint("joint_speed_bound", 1),
    "joint_position_limit_rad.1.low": of_joint("joint_lower", 0),
    **{f"bounds_mm.{name}.{end}": of_bound(name, k) for name in ("L", "h_sy") for k, end in enumerate(("low", "high"))},
}


@pytest.mark.parametrize("name", [name for name in LIMITS if not name.startswith("joint_")])
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


def test_slope_in_a_joints_own_speed_limit() -> None:
    bound = _with(np.full(6, np.inf), 1, 1.5)
    p = problem(robot=replace(UR5, joint_speed_bound=bound))
    assert slope(p, "joint_speed_limit_rad_s.2") == pytest.approx(difference(p, "joint_speed_limit_rad_s.2"), rel=0.05)


def test_slope_in_a_joints_range() -> None:
    """A motion that begins close to the end of the first joint's range, and towards it."""
    robot = replace(UR5, joint_lower=_with(UR5.joint_lower, 0, -0.05))
    task = Task(np.zeros(6), np.full(6, 0.6), 2.0, start_speed=_with(np.zeros(6), 0, -3.0))
    p = problem(robot=robot, task=task)
    name = "joint_position_limit_rad.1.low"
    expected = difference(p, name)
    assert expected > 1
    assert slope(p, name) == pytest.approx(expected, rel=SECOND_ORDER)


def shared(problems: list[Problem], start: SharedStart, worst_share: float) -> SharedOptimum:
    found = solve_shared(problems, [1.0, 2.0], start, SHARP, worst_share=worst_share)
    assert found.success
    return found


@pytest.mark.parametrize("worst_share", [0.0, 0.5])
def test_slopes_of_the_shared_optimum_in_the_limits_of_its_design(worst_share: float) -> None:
    """Of the whole, weights and the worst task included."""
    tasks = [Task(np.full(6, stroke), np.zeros(6), payload) for stroke, payload in ((0.3, 4.0), (0.8, 1.0))]
    problems = [problem(task=task) for task in tasks]
    own = [solved(p) for p in problems]
    assert own[1].design is not None
    start = SharedStart(own[1].design, [s.motion for s in own if s.motion is not None])
    found = shared(problems, start, worst_share)
    assert found.design is not None
    nearby = replace(start, design=found.design)
    assert {"bounds_mm.L.low", "flux_density_limit_T", "bounds_mm.h_sy.low"} & set(found.design_limits)
    for name, limit in found.design_limits.items():
        if name not in LIMITS:
            continue
        value, changed = LIMITS[name]
        step = CHANGE * value(problems[0])
        high, low = (
            shared([changed(p, value(p) + sign * step) for p in problems], nearby, worst_share).objective
            for sign in (1, -1)
        )
        assert limit.slope == pytest.approx((high - low) / (2 * step), rel=SECOND_ORDER, abs=2e-4 * found.objective)


def test_only_what_holds_back_binds_and_has_its_unit() -> None:
    found = solved(problem())
    assert found.objective is not None
    assert found.lam_x is not None
    assert found.lam_g is not None
    every = limit_slopes(found.problem, found.lam_x, found.lam_g)
    binds = binding(every, found.objective)
    assert {"current_limit_A", "flux_density_limit_T"} <= set(binds)
    assert "joint_position_limit_rad.1.low" not in binds
    assert {unit_of(name) for name in every} == {"A", "V", "rad/s", "rad", "mm", "kg", "T", "s"}
