"""Which starts are tried, and which answer is kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from services.codesign import ladder as ladder_module
from services.codesign.freedom import TieBreak
from services.codesign.ladder import FROM_COARSE, ON_COARSE, SHORT
from services.codesign.motor_data import MotorData
from services.codesign.problem import Objective, Problem, Task, Transcription
from services.codesign.solve import solve
from services.codesign.solver import STOPPED, CentralPath, run
from tests.numerics.tasks import UR5, paper_problem, solved
from tests.numerics.test_freedom import GEARS, Freedom

COARSE_FIRST = [ON_COARSE, FROM_COARSE]


def names(solution):
    return [attempt.name for attempt in solution.attempts]


def test_few_intervals_have_no_coarse_grid():
    few = replace(paper_problem(0.6, 2.0), transcription=Transcription(intervals=20))
    assert names(solve(few)) == ["quintic"]


def test_what_takes_long_starts_from_the_quintic():
    """All joints through most of their ranges: 4 s at least."""
    far = Problem(UR5, Task(-0.9 * UR5.joint_upper, 0.9 * UR5.joint_upper, 1.0))
    solution = solve(far)
    assert names(solution) == ["quintic"]
    assert solution.measures.final_time > SHORT


def test_a_given_time_is_not_searched_on_a_coarse_grid():
    given = Objective("time", final_time_bounds=(0.5, 0.5))
    assert names(solve(replace(paper_problem(0.6, 2.0), objective=given))) == ["quintic"]


@pytest.mark.parametrize("spare", [1e-3, 1e-2])
def test_the_latest_time_does_not_bind_the_coarse_grid(spare):
    """Which takes more time than fifty intervals, and would find no motion."""
    shortest = solved(0.6, 2.0).objective
    tight = Objective("time", final_time_bounds=(0.05, shortest * (1 + spare)))
    solution = solve(replace(paper_problem(0.6, 2.0), objective=tight))
    assert names(solution) == COARSE_FIRST
    assert solution.objective == pytest.approx(shortest, rel=3e-4)  # what tolerance 1e-6 leaves


def test_gear_ratios_found_on_the_coarse_grid_are_kept(monkeypatch):
    starts = {}

    def remembering(program, instance, start, options, **rest):
        outcome = run(program, instance, start, options, **rest)
        starts[rest["path"]] = program.gear_shares(start.x), program.gear_shares(outcome.x)
        return outcome

    monkeypatch.setattr(ladder_module, "run", remembering)
    problem = replace(paper_problem(0.6, 2.0), freedom=Freedom(GEARS))
    assert names(solve(problem)) == COARSE_FIRST
    assert np.array_equal(starts[CentralPath.BEGINNING][0], np.ones(6))
    assert np.abs(starts[CentralPath.BEGINNING][1] - 1).max() > 0.1
    np.testing.assert_allclose(starts[CentralPath.END][0], starts[CentralPath.BEGINNING][1])


def promise_too_much(monkeypatch):
    """From now on the motion takes no time on the coarse grid."""
    coarse = ladder_module._coarse

    def promising(problem, program, instance, design, climber, **rest):
        guess = coarse(problem, program, instance, design, climber, **rest)
        climber.promised = 0.0
        return guess

    monkeypatch.setattr(ladder_module, "_coarse", promising)


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_a_motion_slower_than_the_coarse_grids_is_sought_again(monkeypatch, share):
    """From the quintic guess, and the better one is kept: the first or the second, as its time is changed."""
    outcomes = {}

    def weighed(program, instance, start, options, **rest):
        outcome = run(program, instance, start, options, **rest)
        path = rest["path"]
        outcomes[path] = replace(outcome, objective=outcome.objective * (share if path is CentralPath.END else 1))
        return outcomes[path]

    monkeypatch.setattr(ladder_module, "run", weighed)
    promise_too_much(monkeypatch)
    solution = solve(paper_problem(0.6, 2.0))
    assert names(solution) == [*COARSE_FIRST, "quintic"]
    assert solution.success
    better = outcomes[CentralPath.END if share < 1 else CentralPath.WHOLE]
    np.testing.assert_array_equal(solution.x, better.x)


def failing_at(attempt, monkeypatch):
    """From now on the attempt with this number has three iterations."""

    def short(program, instance, start, options, **rest):
        few = replace(options, max_iter=3) if rest["attempt"] == attempt else options
        return run(program, instance, start, few, **rest)

    monkeypatch.setattr(ladder_module, "run", short)


def test_a_doubtful_answer_is_better_than_none(monkeypatch):
    own = solve(paper_problem(0.6, 2.0))
    promise_too_much(monkeypatch)
    failing_at(2, monkeypatch)
    solution = solve(paper_problem(0.6, 2.0))
    assert [attempt.status for attempt in solution.attempts] == [
        "Solve_Succeeded",
        "Solve_Succeeded",
        "Maximum_Iterations_Exceeded",
    ]
    assert solution.success
    assert solution.objective == own.objective


def test_a_stop_after_a_doubtful_answer_is_a_stop(monkeypatch):
    promise_too_much(monkeypatch)
    solution = solve(paper_problem(0.6, 2.0), progress=lambda report: report.attempt == 2)
    assert solution.status == STOPPED
    assert solution.design is None
    assert solution.reason == f"stopped on request after {solution.iterations} iterations"


def test_one_failed_attempt_is_enough_where_no_motor_holds_the_payload():
    weak = replace(MotorData(), current_limit=0.25)
    solution = solve(replace(paper_problem(0.6, 4.0), motor=weak))
    assert names(solution) == [ON_COARSE]
    assert "joint 2 must hold" in solution.reason


@pytest.mark.parametrize(
    ("kind", "attempts"),
    [
        ("time", [*COARSE_FIRST, "tie-break: lightest"]),
        ("weighted", [*(f"references: {name}" for name in COARSE_FIRST), "given start", "tie-break: lightest"]),
    ],
)
def test_every_attempt_has_a_number_of_its_own(kind, attempts):
    seen = []
    problem = replace(paper_problem(0.6, 2.0, kind, 0.5), tie_break=TieBreak())
    solution = solve(problem, progress=lambda report: bool(seen.append(report.attempt)))
    assert names(solution) == attempts
    assert [seen.count(k) for k in range(len(attempts))] == [attempt.iterations + 1 for attempt in solution.attempts]
