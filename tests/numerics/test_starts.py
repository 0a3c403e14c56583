"""Several starts for one task: what they are, which answer is kept, and what is told of the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from services.codesign.accuracy import solve_accurately
from services.codesign.freedom import Freedom
from services.codesign.guess import quintic_guess
from services.codesign.instance import build_instance
from services.codesign.problem import FIRST, Accuracy, Problem, Transcription
from services.codesign.program import load_program
from services.codesign.reconcile import violation
from services.codesign.solve import SolverOptions, solve
from services.codesign.solver import STOPPED
from services.codesign.starts import SAME_END, SLOWEST, StartRun, ends, solve_from_starts, starting_point
from tests.numerics.tasks import paper_problem

COARSE = Transcription(intervals=15)
OPTIONS = SolverOptions()
STARTS = 4


def problem(kind: str = "time", **changes) -> Problem:
    return paper_problem(0.6, 2.0, kind, transcription=COARSE, **changes)


def test_one_start_is_the_usual_solve():
    one, usual = solve_from_starts(problem(), 1, OPTIONS), solve(problem())
    assert one.runs == ()
    assert np.array_equal(one.solution.x, usual.x)
    assert [attempt.name for attempt in one.solution.attempts] == ["quintic"]


@pytest.mark.parametrize("kind", ["time", "energy"])
def test_the_best_is_kept_with_the_effort_of_all(kind):
    found, usual = solve_from_starts(problem(kind), STARTS, OPTIONS), solve(problem(kind))
    solution, objectives = found.solution, [run.objective for run in found.runs]
    assert len(objectives) == STARTS
    assert objectives[0] == usual.objective
    assert solution.objective == min(objectives)
    assert [attempt.name for attempt in solution.attempts] == ["quintic", "start 1", "start 2", "start 3"]
    assert solution.iterations == sum(run.iterations for run in found.runs)
    assert solution.solve_time == pytest.approx(sum(run.seconds for run in found.runs))


def test_each_start_begins_where_it_says():
    """Start 2, made by hand: its ladder has the given start first."""
    asked = problem()
    program = load_program(asked.robot, asked.layout, COARSE.intervals)
    design, stretch = starting_point(asked, 2)
    guess = quintic_guess(asked, program, build_instance(asked, program), design, stretch)
    by_hand = solve(asked, guess)
    assert [attempt.name for attempt in by_hand.attempts] == ["given start"]
    assert solve_from_starts(asked, 3, OPTIONS).runs[2].objective == by_hand.objective


def test_starting_points_differ_and_are_feasible():
    points = [starting_point(problem(), k) for k in range(1, 9)]
    again = starting_point(problem(), 3)
    assert np.array_equal(points[2][0], again[0])
    assert points[2][1] == again[1]
    stretches = [stretch for _, stretch in points]
    assert all(1 <= stretch <= SLOWEST for stretch in stretches)
    assert len(set(stretches)) == len(points)
    motors = np.concatenate([design for design, _ in points])
    assert max(violation(motor, problem().motor) for motor in motors) < 1e-6
    assert (np.ptp(motors, axis=0) > 0.2 * np.ptp([problem().motor.lower, problem().motor.upper], axis=0)).all()


def test_a_given_design_is_kept():
    design = solve(problem()).design
    found = solve_from_starts(problem(design=design), 3, OPTIONS)
    assert np.array_equal(found.solution.design, design)
    assert len(found.runs) == 3


def test_motors_that_are_to_be_alike_are_alike_from_every_start():
    found = solve_from_starts(problem(freedom=Freedom(identical=((0, 1, 2, 3, 4, 5),))), 3, OPTIONS)
    assert [run.objective is None for run in found.runs] == [False] * 3
    assert np.ptp(found.solution.design, axis=0).max() == 0.0
    assert min(run.objective for run in found.runs) > solve(problem()).objective * 1.05


def test_with_design_and_time_given_there_is_one_start():
    asked = problem("energy", design=solve(problem("energy")).design)
    assert len(solve_from_starts(asked, 5, OPTIONS).runs) == 1


def test_a_stop_between_starts_is_a_stop():
    solution = solve_from_starts(problem(), STARTS, OPTIONS, lambda report: report.attempt == 2).solution
    assert solution.status == STOPPED
    assert solution.design is None
    assert [attempt.name for attempt in solution.attempts] == ["quintic", "start 1", "start 2"]


def test_when_all_fail_the_first_ones_reason_stands():
    options = SolverOptions(max_iter=3)
    found, usual = solve_from_starts(problem(), 2, options), solve(problem(), options=options)
    assert found.solution.reason == usual.reason
    assert [run.objective for run in found.runs] == [None, None]
    assert ends(found.runs) == []


def test_accurate_solves_refine_the_best():
    first, loose = replace(FIRST, intervals=10), Accuracy(1.0, 10.0, 1.0)
    found = solve_accurately(problem(), loose, OPTIONS, first=first, starts=3)
    assert found.met
    assert found.solution.objective == min(run.objective for run in found.starts)
    assert len(found.starts) == 3
    assert solve_accurately(problem(), loose, OPTIONS, first=first).starts == ()


def test_ends_are_grouped_by_their_objective():
    close = SAME_END / 3
    values = [2.0, 1.0, None, 1.0 + close, 2.0 + close, 1.5, 1.0 - close]
    runs = [StartRun("", value, 1, 0.0) for value in values]
    found = [(end.objective, end.starts) for end in ends(runs)]
    assert found == [(1.0 - close, 3), (1.5, 1), (2.0, 2)]


def test_ends_of_an_energy_below_zero():
    runs = [StartRun("", value, 1, 0.0) for value in (-5.0, -4.0, -5.0001)]
    assert [(end.objective, end.starts) for end in ends(runs)] == [(-5.0001, 2), (-4.0, 1)]
