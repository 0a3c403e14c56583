"""One task solved: the motion obeys the paper's model and limits, a failure is a value, a solve can be stopped."""

from __future__ import annotations

import os
import signal
import threading
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from services.codesign import solve as solve_module
from services.codesign.guess import Guess, quintic_guess, starting_design
from services.codesign.instance import EFFORT_SCALE, build_instance, scales_of
from services.codesign.kernels import _virtual_machine
from services.codesign.motor import constraint_limits, evaluate_motor
from services.codesign.optimality import optimality
from services.codesign.problem import Objective, Problem, Task, Transcription
from services.codesign.program import Program, build_program, load_program
from services.codesign.solve import Solution, SolverOptions, solve
from services.codesign.solver import OUT_OF_TIME, STOPPED, run
from tests.numerics.arms import State, Tree
from tests.numerics.tasks import UR5, paper_problem, paper_task, solved

TOLERANCE = 1e-6
"""Relative to a limit or scale: the solver's tol."""

MOVING = Task(
    start=np.array([0.5, -0.4, 0.8, 0.1, -0.6, 1.0]),
    end=np.array([-0.3, 0.6, -0.2, 0.9, 0.5, -1.0]),
    payload=1.5,
    start_speed=np.array([0.3, -0.2, 0.4, 0.0, 0.5, -0.6]),
    end_speed=np.array([-0.4, 0.3, -0.2, 0.5, 0.1, 0.2]),
    duration=0.9,
)
"""General end states: nothing at rest, nothing at zero."""


@pytest.fixture(params=["time", "energy", "moving"], scope="module")
def solution(request) -> Solution:
    if request.param == "moving":
        return solve(Problem(UR5, MOVING))
    return solved(0.6, 2.0, request.param)


def test_first_order_conditions_hold(solution):
    assert solution.success
    assert solution.status == "Solve_Succeeded"
    assert solution.reason is None
    assert solution.kkt_residual < 10 * TOLERANCE  # IPOPT measures in units of its own scaling
    assert solution.constraint_violation < TOLERANCE


def test_motion_goes_from_start_to_end(solution):
    task, motion = solution.problem.task, solution.motion
    speed = UR5.joint_speed_limit
    assert np.array_equal(motion.position[0], task.start)
    assert np.allclose(motion.position[-1], task.end, rtol=0, atol=TOLERANCE)
    assert np.allclose(motion.speed[0], task.start_velocity, rtol=0, atol=TOLERANCE * speed)
    assert np.allclose(motion.speed[-1], task.end_velocity, rtol=0, atol=TOLERANCE * speed)
    assert (motion.current_d[0] == 0).all()
    assert (motion.current_q[0] == 0).all()


def test_limits_hold_at_every_point(solution):
    """(3a), (3b) and (5), read off the returned motion."""
    motion, motor = solution.motion, solution.problem.motor
    over = 1 + TOLERANCE
    assert (motion.position >= UR5.joint_lower - TOLERANCE).all()
    assert (motion.position <= UR5.joint_upper + TOLERANCE).all()
    assert (np.abs(UR5.gear_ratio * motion.speed) <= 100 * np.pi * over).all()
    for current in (motion.current_d, motion.current_q):
        assert (np.abs(current) <= 3.0 * over).all()
    for voltage in (motion.voltage_d, motion.voltage_q):
        assert (np.abs(voltage) <= 100.0 * over).all()
    assert motor.current_limit == 3.0
    assert motor.voltage_limit == 100.0


def test_design_is_within_bounds_and_constraints(solution):
    """(2a)-(2e), (3c)."""
    motor = solution.problem.motor
    assert solution.design.shape == (6, 7)
    assert (solution.design >= motor.lower * (1 - TOLERANCE)).all()
    assert (solution.design <= motor.upper * (1 + TOLERANCE)).all()
    low, high = constraint_limits(motor)
    for row in solution.design:
        values = np.array(list(evaluate_motor(row, motor)[1].values()))
        assert (values >= low - TOLERANCE * np.abs(low)).all()
        assert (values <= high + TOLERANCE * np.abs(high)).all()


def test_motion_obeys_the_printed_motor_equations(solution):
    """Eq. (1), integrated by implicit Euler (one Radau point), motor by motor."""
    motion, h = solution.motion, np.diff(solution.motion.time)[:, None]
    motors = [evaluate_motor(row, solution.problem.motor)[0] for row in solution.design]
    R, L, Phi = (
        np.array([getattr(m, name) for m in motors]) for name in ("phase_resistance", "inductance", "flux_linkage")
    )
    i_d, i_q, omega = motion.current_d[1:], motion.current_q[1:], UR5.gear_ratio * motion.speed[1:]
    di_d, di_q = np.diff(motion.current_d, axis=0) / h, np.diff(motion.current_q, axis=0) / h
    P = 4
    u_d = R * i_d - L * P * omega * i_q + L * di_d
    u_q = R * i_q + L * P * omega * i_d + P * omega * Phi + L * di_q
    assert np.allclose(motion.voltage_d[1:], u_d, rtol=0, atol=100 * TOLERANCE)
    assert np.allclose(motion.voltage_q[1:], u_q, rtol=0, atol=100 * TOLERANCE)
    assert np.allclose(motion.torque, UR5.gear_ratio * 1.5 * P * Phi * motion.current_q, rtol=1e-12)


def test_motion_obeys_pinocchio(solution):
    """Eq. (4): at each point the motors' torque is what a tree of 12 bodies needs for the motion's acceleration."""
    motion, h = solution.motion, np.diff(solution.motion.time)[:, None]
    qdd = np.diff(motion.speed, axis=0) / h
    assert np.allclose(np.diff(motion.position, axis=0), h * motion.speed[1:], rtol=0, atol=TOLERANCE)
    scale = scales_of(solution.problem).torque
    for k in range(0, len(qdd), 7):
        q, qd = motion.position[k + 1], motion.speed[k + 1]
        state = State(solution.design, solution.problem.task.payload, UR5.gear_ratio, q, qd, qdd[k])
        needed = Tree(UR5, state).torques(state)
        assert np.allclose(motion.torque[k + 1], needed, rtol=0, atol=TOLERANCE * scale)


def test_measures_are_those_of_the_motion(solution):
    motion, h = solution.motion, np.diff(solution.motion.time)
    effort = h @ (motion.voltage_d[1:] ** 2 + motion.voltage_q[1:] ** 2).sum(axis=1)
    assert solution.measures.effort == pytest.approx(effort, rel=1e-12)
    assert solution.measures.final_time == pytest.approx(motion.time[-1], rel=1e-12)
    expected = solution.measures.final_time if solution.problem.objective.kind == "time" else effort
    assert solution.objective == pytest.approx(expected, rel=1e-12)


def test_optimality_notices_a_point_that_is_not_optimal():
    solution = solved(0.6, 2.0)
    program = load_program(UR5, solution.problem.layout, 50)
    instance = build_instance(solution.problem, program)
    moved = solution.x * (1 + 1e-3 * np.sin(np.arange(len(solution.x))))
    there = optimality(program, instance, moved, solution.lam_x, solution.lam_g)
    assert there.kkt_residual > 1e-4
    assert there.constraint_violation > 1e-4
    without = optimality(program, instance, solution.x, 0 * solution.lam_x, solution.lam_g)
    assert without.kkt_residual > 1e-4
    assert without.constraint_violation == solution.constraint_violation


def test_multipliers_of_a_given_design_are_the_slope_of_the_optimum():
    """Central difference of the optimal energy in each length of motor 2."""
    options = SolverOptions(tol=1e-9)
    problem = replace(
        paper_problem(0.6, 2.0, "energy"), design=solved(0.6, 2.0).design, transcription=Transcription(intervals=15)
    )
    solution = solve(problem, options=options)
    scale, step = scales_of(problem).design, 1e-3
    for k in range(7):
        ends = []
        for sign in (-1, 1):
            design = problem.design.copy()
            design[1, k] += sign * step * scale[k]
            ends.append(solve(replace(problem, design=design), options=options).objective)
        slope = (ends[1] - ends[0]) / (2 * step)
        found = -solution.lam_x[7 + k] / EFFORT_SCALE
        assert found == pytest.approx(slope, rel=1e-3, abs=1e-3 * solution.objective)


@lru_cache(maxsize=2)
def uncompiled_program(dynamics: str) -> Program:
    """On 10 intervals the virtual machine is fast enough; compiling the forward dynamics takes half a minute."""
    layout = Transcription(intervals=10, dynamics=dynamics).layout(6)
    return build_program(_virtual_machine(UR5, layout), layout, 10)


@pytest.mark.parametrize("kind", ["time", "energy"])
def test_forward_and_inverse_dynamics_agree_in_the_objective(kind):
    """The corrected Algorithm 1 and the recursive Newton-Euler residual: same start, both at tol 1e-8."""
    objectives = []
    for dynamics in ("inverse", "forward"):
        transcription = Transcription(intervals=10, dynamics=dynamics)
        problem = replace(paper_problem(0.6, 2.0, kind), transcription=transcription)
        program = uncompiled_program(dynamics)
        instance = build_instance(problem, program)
        start = quintic_guess(problem, program, instance, starting_design(problem))
        outcome = run(program, instance, start, SolverOptions(tol=1e-8))
        assert outcome.success
        objectives.append(outcome.objective)
    assert objectives[0] == pytest.approx(objectives[1], rel=1e-6)


def test_heavier_payload_takes_longer():
    times = [solved(0.2, payload).objective for payload in (0.0, 2.0, 4.0)]
    assert times[0] * 1.02 < times[1] < times[2] / 1.02


def test_solving_again_gives_the_same():
    first, again = solved(0.6, 2.0), solve(paper_problem(0.6, 2.0))
    assert np.array_equal(first.x, again.x)
    assert first.iterations == again.iterations


def test_own_solution_as_a_start():
    own = solved(0.6, 2.0)
    again = solve(own.problem, own.start)
    assert [attempt.name for attempt in again.attempts] == ["given start"]
    assert again.objective == pytest.approx(own.objective, rel=1e-3)  # a neighbouring optimum may be as good


def test_motion_with_a_given_design_keeps_it_and_costs_more():
    own, other = solved(0.6, 2.0), solved(1.0, 4.0)
    solution = solve(replace(own.problem, design=other.design), own.start)
    assert solution.success
    assert np.array_equal(solution.design, other.design)
    assert solution.objective > own.objective * (1 + TOLERANCE)


def test_failed_solve_is_a_value():
    reports = []
    solution = solve(
        paper_problem(0.6, 2.0), options=SolverOptions(max_iter=3), progress=lambda r: bool(reports.append(r))
    )
    assert not solution.success
    assert solution.status == "Maximum_Iterations_Exceeded"
    assert "Maximum_Iterations_Exceeded" in solution.reason
    assert (solution.design, solution.motion, solution.measures, solution.objective) == (None, None, None, None)
    assert np.isfinite(solution.constraint_violation)
    names = [attempt.name for attempt in solution.attempts]
    assert names == ["12 intervals", "quintic", "slower motion", "elastic limits", "strongest motor"]
    assert solution.iterations == sum(attempt.iterations for attempt in solution.attempts) == 15
    assert {report.attempt for report in reports} == {0, 1, 2, 3, 4}
    with pytest.raises(ValueError, match="no start"):
        _ = solution.start


@pytest.mark.parametrize(
    ("kind", "attempt", "name"),
    [("time", 0, "12 intervals"), ("time", 3, "elastic limits"), ("energy", 3, "12 intervals")],
)
def test_a_stop_while_a_rung_looks_for_its_start_is_a_stop(kind, attempt, name):
    """There another program is solved, not the task itself; no rung follows."""
    problem, options = paper_problem(0.6, 2.0, kind=kind), SolverOptions(max_iter=3)
    solution = solve(problem, options=options, progress=lambda report: report.attempt == attempt)
    assert solution.attempts[-1].name == name
    assert solution.status == STOPPED
    assert "stopped on request" in solution.reason


def test_bad_start_falls_back_on_the_ladder():
    own = solved(0.6, 2.0)
    solution = solve(own.problem, Guess(np.full_like(own.x, np.nan)))
    assert solution.success
    assert [attempt.name for attempt in solution.attempts] == ["given start", "12 intervals", "from 12 intervals"]
    assert solution.attempts[0].status == "Invalid_Number_Detected"
    assert solution.objective == own.objective


def test_progress_stops_a_solve():
    seen = []

    def stop(report):
        seen.append(report)
        return report.iteration == 7

    solution = solve(paper_problem(0.6, 2.0), progress=stop)
    assert solution.status == STOPPED
    assert not solution.success
    assert solution.design is None
    assert solution.reason == "stopped on request after 7 iterations"
    assert [report.iteration for report in seen] == list(range(8))
    assert len(solution.attempts) == 1
    assert solve(paper_problem(0.6, 2.0)).success  # the solver object is the same, and has forgotten


def test_exception_in_progress_comes_out():
    def fail(report):
        raise LookupError("from progress")

    with pytest.raises(LookupError, match="from progress"):
        solve(paper_problem(0.6, 2.0), progress=fail)
    assert solve(paper_problem(0.6, 2.0)).success


def test_interrupt_comes_out():
    def interrupt(report):
        if report.iteration == 2:
            os.kill(os.getpid(), signal.SIGINT)
        assert report.iteration < 5, "the solve goes on after Ctrl-C"
        return False

    with pytest.raises(KeyboardInterrupt):
        solve(paper_problem(0.6, 2.0), progress=interrupt)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_interrupt_between_callbacks_comes_out():
    """CasADi looks for signals in every evaluation, and would drop Python's exception there."""
    problem = paper_problem(0.6, 2.0)
    solve(problem)
    for hundredths in range(5, 15):
        timer = threading.Timer(hundredths / 100, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            solve_while(timer.is_alive, problem)
        timer.join()


def solve_while(goes_on, problem):
    while goes_on():
        solve(problem)


def test_interrupt_after_the_solver_comes_out(monkeypatch):
    """Once the answer was looked at, for which CasADi multiplies matrices: it would drop the exception there, too."""
    seen = []

    def looked_at(*arguments):
        os.kill(os.getpid(), signal.SIGINT)
        seen.append(optimality(*arguments))
        return seen[0]

    monkeypatch.setattr(solve_module, "optimality", looked_at)
    with pytest.raises(KeyboardInterrupt):
        solve(paper_problem(0.6, 2.0))
    assert len(seen) == 1
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    monkeypatch.undo()
    assert solve(paper_problem(0.6, 2.0)).success, "the signal is forgotten"


def test_second_solve_at_once_is_refused():
    with pytest.raises(RuntimeError, match="a solve is running"):
        solve(paper_problem(0.6, 2.0), progress=lambda report: solve(paper_problem(0.2, 0.0)).success)


def test_time_limit_ends_the_ladder():
    solution = solve(paper_problem(0.6, 2.0), options=SolverOptions(max_wall_time=0.05))
    assert solution.status == OUT_OF_TIME
    assert "0.05 s" in solution.reason
    assert [attempt.name for attempt in solution.attempts] in (["12 intervals"], ["12 intervals", "from 12 intervals"])


def test_energy_without_duration_is_refused():
    with pytest.raises(ValueError, match="duration"):
        solve(Problem(UR5, replace(paper_task(0.6, 2.0), duration=None), objective=Objective("energy")))
