"""Free gear ratios and identical motors: the same numbers as without, with other variables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from services.codesign import kernels as kernels_module
from services.codesign.certify import certify
from services.codesign.freedom import Freedom, FreedomError, FreeGear
from services.codesign.instance import build_instance
from services.codesign.limits import limit_slopes
from services.codesign.motor_data import DIMENSIONS
from services.codesign.optimality import optimality
from services.codesign.problem import Objective, Problem, Task, Transcription
from services.codesign.program import Program, build_program, program_of
from services.codesign.robot import Robot
from services.codesign.shared_optimum import SharedStart, solve_shared
from services.codesign.solve import solve
from services.codesign.solver import SolverOptions
from tests.numerics.arms import random_robot
from tests.numerics.derivatives import assert_derivatives_of_the_whole

UR5 = Robot.preset("ur5")
SMALL = random_robot(2)
COARSE = Transcription(intervals=10)
ROUNDING = 1e-9
"""Relative to the largest entry: the same numbers, added up in another order."""

GEARS = tuple(FreeGear(joint, 30.0, 200.0) for joint in range(6))
FREEDOMS = [
    Freedom((FreeGear(1, 10.0, 300.0),)),
    Freedom((), ((0, 1),)),
    Freedom((FreeGear(0, 10.0, 300.0), FreeGear(1, 10.0, 300.0)), ((0, 1),)),
]


def small(freedom: Freedom, transcription: Transcription, kind: str = "weighted") -> Problem:
    task = Task(np.array([0.5, -0.4]), np.array([-0.2, 0.3]), 1.0, duration=0.7)
    objective = Objective(kind, alpha=0.4, time_reference=0.5, effort_reference=300.0)
    return Problem(SMALL, task, objective=objective, transcription=transcription, freedom=freedom)


def uncompiled(problem: Problem) -> Program:
    kernels = kernels_module._virtual_machine(problem.robot, problem.layout)
    return build_program(kernels, problem.layout, problem.transcription.intervals, problem.motor_of)


def ur5(stroke: float = 0.6, payload: float = 2.0, kind: str = "time", freedom: Freedom = Freedom()) -> Problem:
    task = Task(np.full(6, stroke), np.zeros(6), payload, duration=1.0)
    return Problem(UR5, task, objective=Objective(kind), transcription=COARSE, freedom=freedom)


@pytest.mark.parametrize("freedom", FREEDOMS)
@pytest.mark.parametrize(
    ("control", "dynamics"), [("voltage", "inverse"), ("current", "inverse"), ("voltage", "forward")]
)
def test_derivatives_equal_those_of_the_whole(freedom: Freedom, control: str, dynamics: str) -> None:
    """With forward dynamics the rotors act on each other: lengths of two motors meet in the Hessian."""
    problem = small(freedom, Transcription("radau", 2, 3, control, dynamics))
    program = uncompiled(problem)
    p = build_instance(problem, program).parameters
    rng = np.random.default_rng(0)
    x = rng.uniform(0.9, 1.1, program.variables)
    x[program.time_index] = 0.6
    assert_derivatives_of_the_whole(program, x, p, rng.normal(size=program.constraints), ROUNDING)


@pytest.mark.parametrize("control", ["voltage", "current"])
def test_a_free_gear_ratio_is_the_given_one_at_its_value(control: str) -> None:
    """At a share of 1.7 the program is the plain one of a robot with 1.7 times the ratio, at the same point."""
    free = small(FREEDOMS[0], Transcription("radau", 2, 3, control))
    geared = replace(free, robot=SMALL.with_gears(SMALL.gear_ratio * [1.0, 1.7]), freedom=Freedom())
    program, plain = uncompiled(free), uncompiled(geared)
    x = np.random.default_rng(1).uniform(0.9, 1.1, plain.variables)
    there = np.insert(x, plain.design_size, 1.7)
    values = plain.nlp(x, build_instance(geared, plain).parameters)
    found = program.nlp(there, build_instance(free, program).parameters)
    for a, b in zip(found, values, strict=True):
        np.testing.assert_allclose(a.full(), b.full(), rtol=0, atol=ROUNDING * np.abs(b.full()).max())


def test_derivatives_in_the_gear_ratio_are_differences_over_robots() -> None:
    """The Jacobian's column against the plain program of two robots whose ratios differ by a little."""
    free = small(FREEDOMS[0], Transcription("radau", 2, 3))
    program = uncompiled(free)
    x = np.random.default_rng(2).uniform(0.9, 1.1, program.variables)
    gear = program.lengths
    step, ends = 1e-5, []
    for sign in (-1, 1):
        robot = SMALL.with_gears(SMALL.gear_ratio * [1.0, x[gear] + sign * step])
        plain_problem = replace(free, robot=robot, freedom=Freedom())
        plain = uncompiled(plain_problem)
        ends.append(plain.nlp(np.delete(x, gear), build_instance(plain_problem, plain).parameters)[1].full().ravel())
    column = program.jac_g(x, build_instance(free, program).parameters)[1].full()[:, gear]
    difference = (ends[1] - ends[0]) / (2 * step)
    np.testing.assert_allclose(column, difference, rtol=1e-6, atol=1e-7 * np.abs(difference).max())


def test_gears_that_may_not_move_change_nothing() -> None:
    held = Freedom(tuple(FreeGear(joint, ratio, ratio) for joint, ratio in enumerate(UR5.gear_ratio)))
    assert solve(ur5(freedom=held)).objective == pytest.approx(solve(ur5()).objective, rel=1e-7)


@pytest.mark.parametrize("kind", ["time", "energy"])
def test_free_gears_are_better_and_what_they_say_is_so(kind: str) -> None:
    """The optimum is better than with 100:1, and the ordinary program with the gears found confirms it."""
    fixed, free = solve(ur5(kind=kind)), solve(ur5(kind=kind, freedom=Freedom(GEARS)))
    assert fixed.objective is not None
    assert free.objective is not None
    assert free.objective < 0.99 * fixed.objective
    found = free.problem.robot.gear_ratio
    assert (np.abs(found) >= 30 - 1e-6).all()
    assert (np.abs(found) <= 200 + 1e-6).all()
    again = solve(replace(ur5(kind=kind), robot=UR5.with_gears(found), design=free.design))
    assert again.objective == pytest.approx(free.objective, rel=1e-5)


def test_what_is_handed_on_is_the_optimum_found() -> None:
    """With the ratios found as the robot's, x and its multipliers still satisfy the optimality conditions."""
    free = solve(ur5(freedom=Freedom(GEARS)))
    program = program_of(free.problem)
    at = optimality(program, build_instance(free.problem, program), free.x, free.lam_x, free.lam_g)
    assert at.kkt_residual == pytest.approx(free.kkt_residual, rel=0.1, abs=1e-9)
    assert at.constraint_violation < 1e-6
    certificate = certify(free)
    assert certificate.limits["rotor_speed"].at_points < 1e-6
    assert limit_slopes(free.problem, free.lam_x, free.lam_g)["current_limit_A"].slope < 0


def test_multiplier_of_a_gear_ratio_is_the_slope_of_the_optimum() -> None:
    """Central difference of the minimum time over the ratio of joint 2, every other number free."""
    options, slopes, ends = SolverOptions(tol=1e-9), [], []
    for ratio in (99.5, 100.0, 100.5):
        gear = FreeGear(1, ratio, ratio)
        problem = replace(ur5(freedom=Freedom((gear,))), robot=UR5.with_gears([100, ratio, 100, 100, 100, 100]))
        found = solve(problem, options=options)
        ends.append(found.objective)
        slopes.append(-found.lam_x[program_of(found.problem).lengths] / ratio)
    assert slopes[1] == pytest.approx(ends[2] - ends[0], rel=1e-2)


def test_identical_motors_are_identical_and_no_better() -> None:
    pair = Freedom((), ((0, 1, 2), (3, 4, 5)))
    fixed, alike = solve(ur5()), solve(ur5(freedom=pair))
    assert alike.design is not None
    for group in pair.identical:
        assert np.ptp(alike.design[list(group)], axis=0).max() == 0.0
    assert alike.objective > fixed.objective * (1 + 1e-6)
    again = solve(replace(ur5(), design=alike.design))
    assert again.objective == pytest.approx(alike.objective, rel=1e-5)
    assert program_of(alike.problem).design_size == 2 * len(DIMENSIONS)


def test_the_shared_optimum_has_both_freedoms() -> None:
    """Better with free gears than without, and identical motors are no better than free ones."""
    tasks, totals = ((0.2, 4.0), (1.0, 0.0)), {}
    for name, freedom in (
        ("plain", Freedom()),
        ("gears", Freedom(GEARS)),
        ("alike", Freedom((), ((0, 1, 2), (3, 4, 5)))),
    ):
        problems = [ur5(*task, freedom=freedom) for task in tasks]
        own = [solve(problem) for problem in problems]
        start = SharedStart(own[1].design, [s.motion for s in own])
        problems = [replace(problem, robot=own[1].problem.robot) for problem in problems]
        found = solve_shared(problems, [1.0, 1.0], start, SolverOptions())
        assert found.success
        robot = UR5.with_gears(found.gear_ratio)
        again = [solve(replace(p, robot=robot, design=found.design, freedom=Freedom())) for p in problems]
        totals[name] = sum(s.objective for s in again)
        assert totals[name] == pytest.approx(found.objective, rel=1e-3)
        if name == "alike":
            assert np.ptp(found.design[3:], axis=0).max() == np.ptp(found.design[:3], axis=0).max() == 0.0
    assert totals["gears"] < 0.99 * totals["plain"]
    assert totals["alike"] > totals["plain"] * (1 + 1e-4)


@pytest.mark.parametrize(
    ("freedom", "message"),
    [
        (Freedom((FreeGear(6, 10, 20),)), "must be a joint, 1 to 6"),
        (Freedom((), ((0, 1), (1, 2))), "names this joint twice"),
        (Freedom((FreeGear(0, 20, 10),)), "0 < low <= high"),
        (Freedom((FreeGear(0, 10, 200),)), "own speed limit"),
    ],
)
def test_what_an_arm_cannot_have_is_refused(freedom: Freedom, message: str) -> None:
    robot = replace(UR5, joint_speed_bound=np.full(6, 2 * np.pi))
    with pytest.raises(FreedomError, match=message):
        freedom.check(robot)


def test_a_joint_in_motion_at_the_ends_keeps_its_gear() -> None:
    task = replace(ur5().task, end_speed=np.array([0, 0.1, 0, 0, 0, 0]))
    with pytest.raises(ValueError, match="at rest"):
        replace(ur5(), task=task, freedom=Freedom(GEARS))
