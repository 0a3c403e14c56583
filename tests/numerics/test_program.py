"""The assembled program: its derivatives against CasADi's own, its size, its bounds, and one kernel for all numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from services.codesign import kernels as kernels_module
from services.codesign.instance import build_instance, scales_of
from services.codesign.interval import CONTROLS
from services.codesign.motor_data import MotorData
from services.codesign.problem import Objective, Problem, Task, Transcription
from services.codesign.program import Program, build_program
from services.codesign.reconcile import feasible_design
from services.codesign.robot import Robot
from tests.numerics.arms import random_robot
from tests.numerics.derivatives import assert_derivatives_of_the_whole

ROUNDING = 1e-9
"""Relative to the largest entry: the same derivatives, summed in another order."""

TRANSCRIPTIONS = [
    Transcription(scheme, degree, 3, control)
    for scheme, degree in (("radau", 1), ("radau", 3), ("legendre", 1), ("legendre", 2))
    for control in CONTROLS
] + [Transcription("radau", 2, 1), Transcription("legendre", 1, 1, "current")]
ROBOT = random_robot(2)
TASK = Task(
    start=np.array([0.5, -0.4]),
    end=np.array([-0.2, 0.3]),
    payload=1.0,
    start_speed=np.array([0.1, -0.3]),
    end_speed=np.array([0.2, 0.4]),
    duration=0.7,
)


def problem_of(transcription: Transcription, **changes) -> Problem:
    return Problem(ROBOT, TASK, transcription=transcription, **changes)


def program_of(problem: Problem) -> Program:
    kernels = kernels_module._virtual_machine(problem.robot, problem.layout)
    return build_program(kernels, problem.layout, problem.transcription.intervals)


@pytest.fixture(params=TRANSCRIPTIONS, ids=lambda t: f"{t.scheme}-{t.degree}-{t.intervals}-{t.control}")
def problem(request):
    weighted = Objective("weighted", alpha=0.4, time_reference=0.5, effort_reference=300.0)
    return problem_of(request.param, objective=weighted)


def test_derivatives_equal_those_of_the_whole(problem):
    program = program_of(problem)
    widths = (0.2, 0.5, 0.3) if program.intervals == 3 else (1.0,)
    problem = replace(problem, transcription=replace(problem.transcription, widths=widths))
    p = build_instance(problem, program).parameters
    rng = np.random.default_rng(0)
    x = rng.uniform(0.9, 1.1, program.variables)
    x[program.time_index] = 0.6
    assert_derivatives_of_the_whole(program, x, p, rng.normal(size=program.constraints), ROUNDING)


def test_paper_sizes():
    """Section III-D: n_w = 50, d = 1 gives 50 x 36 + 42 = 1842 variables, and t_f."""
    problem = Problem(Robot.preset("ur5"), Task(np.full(6, 0.6), np.zeros(6), 2.0))
    assert problem.layout.variables == 36
    assert 50 * problem.layout.variables + 42 == 1842


def test_split_and_join_are_inverse(problem):
    program = program_of(problem)
    x = np.arange(float(program.variables))
    assert np.array_equal(program.join(*program.split(x)), x)


def test_every_stop_is_within_range_speed_current_and_voltage(problem):
    """Path limits (3a), (3b), (5) at every collocation point and at the interval's end."""
    program = program_of(problem)
    instance, scales, n, layout = build_instance(problem, program), scales_of(problem), 2, program.layout
    _, _, low = program.split(instance.lower_x)
    _, _, high = program.split(instance.upper_x)
    for w in range(program.intervals):
        for j in range(layout.stops):
            at = slice(layout.point_size * j, layout.point_size * (j + 1))
            lower, upper = low[w, at], high[w, at]
            if (w, j) == (program.intervals - 1, layout.stops - 1):
                end = np.concatenate([TASK.end, TASK.end_velocity / scales.speed])
                assert np.array_equal(lower[: 2 * n], end)
                assert np.array_equal(upper[: 2 * n], end)
            else:
                assert np.array_equal(lower[:n], ROBOT.joint_lower)
                assert np.array_equal(upper[:n], ROBOT.joint_upper)
                assert upper[n : 2 * n] * scales.speed == pytest.approx(100 * np.pi / np.abs(ROBOT.gear_ratio))
                assert np.array_equal(lower[n : 2 * n], -upper[n : 2 * n])
            if layout.control == "voltage":
                assert upper[2 * n :] * scales.current == pytest.approx(3.0)
                assert lower[2 * n :] * scales.current == pytest.approx(-3.0)
    tail = slice(layout.point_size * layout.stops, None)
    assert np.array_equal(high[:, tail], np.ones((program.intervals, 2 * n)))
    assert np.array_equal(low[:, tail], -np.ones((program.intervals, 2 * n)))
    rows = program.interval_constraints * program.intervals
    bounds = instance.upper_g[:rows].reshape(program.intervals, -1)
    assert np.array_equal(bounds[:, : layout.equalities], np.zeros((program.intervals, layout.equalities)))
    assert np.array_equal(bounds[:, layout.equalities :], np.ones((program.intervals, layout.inequalities)))
    assert np.array_equal(instance.lower_g[:rows], -instance.upper_g[:rows])


def test_start_is_given_and_currents_begin_at_zero(problem):
    program = program_of(problem)
    scales, instance = scales_of(problem), build_instance(problem, program)
    before = sum(kernels_module.parameter_sizes(2).values())
    start = instance.parameters[before : before + 8] * scales.state()
    assert start == pytest.approx(np.concatenate([TASK.start, TASK.start_velocity, np.zeros(4)]))


def test_given_design_is_held_and_not_judged():
    design = np.tile(feasible_design(MotorData()), (2, 1)) * 0.5
    problem = problem_of(TRANSCRIPTIONS[0], design=design)
    program = program_of(problem)
    instance = build_instance(problem, program)
    for bounds in (instance.lower_x, instance.upper_x):
        assert program.split(bounds)[0] * scales_of(problem).design == pytest.approx(design)
    assert np.isneginf(instance.lower_g[-12:]).all()
    assert np.isposinf(instance.upper_g[-12:]).all()


@pytest.mark.parametrize(
    ("objective", "low", "high"),
    [
        (Objective("time"), 0.05, 20.0),
        (Objective("energy"), 0.7, 0.7),
        (Objective("weighted", 0.5, 1.0, 1.0), 0.05, 20.0),
    ],
    ids=["time", "energy", "weighted"],
)
def test_final_time_is_free_or_the_duration(objective, low, high):
    problem = problem_of(TRANSCRIPTIONS[0], objective=objective)
    program = program_of(problem)
    instance = build_instance(problem, program)
    assert (instance.lower_x[program.time_index], instance.upper_x[program.time_index]) == (low, high)


def test_energy_needs_a_duration():
    task = Task(np.zeros(2), np.ones(2))
    with pytest.raises(ValueError, match="duration"):
        _ = Problem(ROBOT, task, objective=Objective("energy")).final_time_bounds


def test_weighted_objective_needs_its_references():
    problem = problem_of(TRANSCRIPTIONS[0], objective=Objective("weighted", 0.5))
    with pytest.raises(ValueError, match="time_reference"):
        build_instance(problem, program_of(problem))


def test_unknown_objective_is_refused():
    with pytest.raises(ValueError, match=r"objective\.kind 'cost'"):
        Objective("cost")


def test_forward_and_inverse_dynamics_have_the_same_solutions():
    """A point on which the residual of one form vanishes makes that of the other vanish too."""
    forms = [problem_of(Transcription("radau", 2, 3, dynamics=form)) for form in ("inverse", "forward")]
    programs = [program_of(problem) for problem in forms]
    p = build_instance(forms[0], programs[0]).parameters
    x = np.full(programs[0].variables, 0.3)
    x[: programs[0].design_size] = 1.0
    step = 3 * programs[0].layout.equalities
    unknown = np.ones(len(x), dtype=bool)
    unknown[: programs[0].time_index + 1] = False
    per = programs[0].layout.variables
    for w in range(3):
        unknown[programs[0].time_index + 1 + w * per + per - 4 + np.arange(4)] = False
    for _ in range(12):
        g, jacobian = programs[0].jac_g(x, p)
        x[unknown] -= np.linalg.solve(jacobian.full()[:step, unknown], g.full().ravel()[:step])
    residuals = [np.abs(program.nlp(x, p)[1].full()[:step]).max() for program in programs]
    # 1e-9: Newton's last residual, and as much times the spread of the mass matrix.
    assert max(residuals) < 1e-9
