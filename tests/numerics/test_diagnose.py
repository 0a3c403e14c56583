"""Tasks that cannot be done end quickly, as values, with a reason that names joint, limit and numbers."""

from __future__ import annotations

import re
import time
from dataclasses import replace

import numpy as np
import pytest

from services.codesign.diagnose import explain_failure, impossible
from services.codesign.guess import quintic_guess, starting_design
from services.codesign.instance import build_instance
from services.codesign.ladder import Climb
from services.codesign.motor import evaluate_motor
from services.codesign.motor_data import MotorData
from services.codesign.problem import Objective, Problem, Task, Transcription
from services.codesign.program import load_program
from services.codesign.reconcile import feasible_design, project_design, violation
from services.codesign.solution import NOT_ATTEMPTED
from services.codesign.solve import SolverOptions, solve
from services.codesign.solver import MUMPS, Outcome
from services.codesign.strongest_motor import strongest_motor, strongest_torque
from tests.numerics.tasks import UR5, paper_problem, paper_task, solved

COARSE = Transcription(intervals=15)


def assert_not_attempted(problem: Problem, *parts: str) -> None:
    solution = solve(problem)
    assert not solution.success
    assert solution.status == NOT_ATTEMPTED
    assert solution.attempts == ()
    assert solution.design is None
    for part in parts:
        assert part in solution.reason


def test_rotor_speed_limit_against_the_duration():
    """1 rad in 0.2 s: 1 / pi s = 0.318 s are needed."""
    problem = Problem(UR5, paper_task(1.0, 0.0, 0.2), objective=Objective("energy"))
    assert_not_attempted(problem, "joint 1 must turn 1 rad in 0.2 s", "314.16 rad/s", "gear of 100", "0.318 s")


def test_the_joint_that_is_worst_is_named():
    start = np.array([0.1, 0.1, 0.9, 0.1, 0.1, 0.1])
    problem = Problem(UR5, Task(start, np.zeros(6), duration=0.2), objective=Objective("energy"))
    assert impossible(problem).startswith("joint 3 must turn 0.9 rad")


def test_a_duration_at_the_limit_is_not_refused():
    at = 1 / np.pi
    for duration, refused in ((at, False), (at * 0.999, True)):
        problem = Problem(UR5, paper_task(1.0, 0.0, duration), objective=Objective("energy"))
        assert (impossible(problem) is not None) == refused


def test_latest_final_time_of_a_free_time_counts_too():
    objective = Objective("time", final_time_bounds=(0.05, 0.3))
    assert_not_attempted(Problem(UR5, paper_task(1.0, 0.0), objective=objective), "in 0.3 s")


def test_ends_outside_the_joint_range():
    outside = np.array([0, 0, 2.0, 0, 0, 0])
    assert_not_attempted(Problem(UR5, Task(outside, np.zeros(6))), "joint 3 starts at 2 rad", "-1.885 to 1.885 rad")
    assert_not_attempted(Problem(UR5, Task(np.zeros(6), -outside)), "joint 3 ends at -2 rad")


def test_end_speeds_over_the_rotor_limit():
    fast = np.array([0, 3.2, 0, 0, 0, 0])
    task = paper_task(0.2, 0.0)
    assert_not_attempted(Problem(UR5, replace(task, start_speed=fast)), "joint 2 starts at 3.2 rad/s", "3.142 rad/s")
    assert_not_attempted(Problem(UR5, replace(task, end_speed=-fast)), "joint 2 ends at -3.2 rad/s")


def test_bounds_without_a_motor():
    heavy = MotorData().with_bounds({"L": (0.09, 0.1), "R_so": (0.09, 0.1)})
    assert_not_attempted(
        replace(paper_problem(0.2, 0.0), motor=heavy), "no motor within the bounds", "mass_kg", "at most 3"
    )


def test_payload_that_no_motor_holds():
    """400 kg at 0.82 m of reach."""
    solution = solve(paper_problem(1.0, 400.0, transcription=COARSE))
    assert not solution.success
    assert len(solution.attempts) == 1  # hopeless by far: the ladder is not climbed
    assert "likely, though not proven" in solution.reason
    assert "joint 2 must hold 3," in solution.reason
    assert "at 3 A through a gear of 100" in solution.reason


def test_duration_shorter_than_the_fastest_motion():
    """0.35 s is more than the rotor limit needs, and less than the fastest motion takes."""
    task = paper_task(1.0, 0.0, 0.35)
    problem = Problem(UR5, task, objective=Objective("energy"), transcription=COARSE)
    solution, fastest = solve(problem), solve(replace(problem, objective=Objective("time")))
    assert not solution.success
    found = re.search(
        r"the shortest motion found with any motors takes (\S+) s, and 0.35 s are allowed", solution.reason
    )
    assert float(found[1]) == pytest.approx(fastest.objective, rel=5e-3)


def test_motors_too_weak_for_the_task_they_are_given():
    """The motors that are best for a long stroke in 1 s cannot lift 4 kg over a short one."""
    weak = solve(paper_problem(1.0, 4.0, "energy", transcription=COARSE)).design
    solution = solve(paper_problem(0.2, 4.0, "energy", transcription=COARSE, design=weak))
    assert not solution.success
    assert "joint 2 must hold" in solution.reason
    assert "the given motor gives at most" in solution.reason


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (1, "speed and position of joint 2"),
        (6 + 2, "motor 3 misses the torque that joint 3 needs"),
        (12 + 4, "d-axis voltage of motor 5"),
        (18 + 5, "q-axis voltage of motor 6"),
    ],
)
def test_the_largest_violation_is_put_in_words(row, words):
    """A solved point with one equation moved away by hand."""
    solution = solved(0.6, 2.0)
    program = load_program(UR5, solution.problem.layout, 50)
    instance = build_instance(solution.problem, program)
    target = 9 * program.interval_constraints + row
    lower, upper = instance.lower_g.copy(), instance.upper_g.copy()
    lower[target], upper[target] = 0.5, 0.5
    moved = replace(instance, lower_g=lower, upper_g=upper)
    outcome = Outcome("Infeasible_Problem_Detected", solution.x, solution.lam_x, solution.lam_g, 0.0, 10, 0.1, MUMPS)
    reason = explain_failure(
        solution.problem, program, moved, Climb(outcome, ()), options=SolverOptions(), progress=None
    )
    assert words in reason
    assert "20% into the motion" in reason


@pytest.mark.parametrize("is_over", [False, True])
def test_the_fastest_motion_is_looked_for_in_the_time_that_is_left(is_over):
    """A motion that has 0.2 s, and takes 0.31 s."""
    late = replace(paper_problem(0.6, 2.0), objective=Objective("time", final_time_bounds=(0.05, 0.2)))
    program = load_program(UR5, late.layout, 50)
    instance = build_instance(late, program)
    start = quintic_guess(late, program, instance, starting_design(late))
    nothing = np.zeros(program.variables), np.zeros(program.constraints)
    outcome = Outcome("Infeasible_Problem_Detected", start.x, *nothing, 0.0, 10, 0.1, MUMPS)
    told = []
    reason = explain_failure(
        late,
        program,
        instance,
        Climb(outcome, ()),
        options=SolverOptions(),
        progress=told.append,
        deadline=time.monotonic() if is_over else np.inf,
    )
    assert ("the shortest motion found with any motors takes 0.3" in reason) is not is_over
    assert (len(told) <= 1) is is_over


def test_strongest_motor_is_feasible_and_beats_every_other():
    motor = MotorData()
    strongest = strongest_motor(motor)
    assert violation(strongest, motor) < 1e-6
    assert strongest_torque(motor) == pytest.approx(1.5 * 4 * 3 * evaluate_motor(strongest, motor)[0].flux_linkage)
    rng = np.random.default_rng(0)
    others = [project_design(rng.uniform(motor.lower, motor.upper)[None, :], motor) for _ in range(30)]
    fluxes = [evaluate_motor(other.design[0], motor)[0].flux_linkage for other in others if other.feasible]
    fluxes += [evaluate_motor(row, motor)[0].flux_linkage for row in solved(1.0, 4.0).design]
    fluxes.append(evaluate_motor(feasible_design(motor), motor)[0].flux_linkage)
    assert len(fluxes) > 15
    assert max(fluxes) <= evaluate_motor(strongest, motor)[0].flux_linkage * (1 + 1e-6)
