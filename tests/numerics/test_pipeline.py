"""From tasks to one design: the paper's application in full, and what a failed task may not do."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from services.codesign.comparison import compare
from services.codesign.pipeline import EMPIRICAL, TWO_STEP, WORST_CASE, co_design, mean_of_solved
from services.codesign.problem import Transcription
from services.codesign.reconcile import violation
from tests.numerics.tasks import paper_grid, paper_problem

TOTALS = json.loads((Path(__file__).parents[1] / "data" / "optima.json").read_text())["paper_application_total_time_s"]

SAME = 2e-3
"""Relative, of a total of optima: they are determined."""

SAME_MEAN = 1e-2
"""Of the total at the mean design: magnets are nearly free in some tasks, and the mean depends on which is taken."""

NEIGHBOUR = 5e-3
"""Relative, of one optimum found from another start: local optima lie side by side."""

COARSE = Transcription(intervals=12)


@pytest.fixture(scope="module")
def paper():
    return co_design(paper_grid("time"))


def test_all_tasks_solve_on_the_first_rung(paper):
    names = [tuple(attempt.name for attempt in solution.attempts) for solution in paper.own]
    assert names == [("12 intervals", "from 12 intervals")] * 25
    assert all(solution.success for solution in paper.own)
    assert paper.comparison.counted == tuple(range(25))


@pytest.mark.parametrize(
    ("method", "reference", "tolerance"),
    [
        ("own", "sum_of_each_task_at_its_own_design", SAME),
        (EMPIRICAL, "empirical_design", SAME),
        (WORST_CASE, "worst_case_design", SAME),
        (TWO_STEP, "mean_then_projected", SAME_MEAN),
    ],
)
def test_totals_of_the_paper_application(paper, method, reference, tolerance):
    assert paper.comparison.totals[method] == pytest.approx(TOTALS[reference], rel=tolerance)


def test_single_task_designs_have_no_regret_on_their_own_task(paper):
    assert abs(paper.comparison.regret[EMPIRICAL][12]) < NEIGHBOUR
    assert abs(paper.comparison.regret[WORST_CASE][24]) < NEIGHBOUR
    assert paper.comparison.total_regret[TWO_STEP] > paper.comparison.total_regret[EMPIRICAL] > 0


def test_mean_and_projection(paper):
    expected = sum(solution.design for solution in paper.own) / 25
    assert np.allclose(paper.mean, expected, rtol=1e-12)
    assert paper.projection.feasible
    motor = paper.own[0].problem.motor
    assert all(violation(row, motor) < 1e-6 for row in paper.projection.design)
    assert np.array_equal(paper.motions[TWO_STEP][3].design, paper.projection.design)


def test_failed_task_never_enters_the_mean():
    good = [paper_problem(stroke, 0.0, "energy", transcription=COARSE) for stroke in (0.4, 0.6)]
    outside = replace(good[0].task, start=np.full(6, 3.0))
    result = co_design([good[0], replace(good[0], task=outside), good[1]], worst_case_task=1)
    assert [solution.success for solution in result.own] == [True, False, True]
    assert np.allclose(result.mean, (result.own[0].design + result.own[2].design) / 2, rtol=1e-12)
    assert WORST_CASE not in result.designs
    assert result.motions[TWO_STEP][1] is None
    assert result.comparison.failed["own"] == (1,)
    assert result.comparison.counted == (0, 2)
    assert result.comparison.regret[TWO_STEP][1] is None


def test_weights_shift_the_mean():
    problems = [paper_problem(stroke, 0.0, "energy", transcription=COARSE) for stroke in (0.4, 1.0)]
    own = co_design(problems).own
    assert np.allclose(mean_of_solved(own, [3, 1]), 0.75 * own[0].design + 0.25 * own[1].design, rtol=1e-12)
    assert np.array_equal(mean_of_solved(own, [0, 2]), own[1].design)
    assert mean_of_solved(own, [0, 0]) is None


def test_nothing_solved_is_a_value_too():
    outside = replace(paper_problem(0.2, 0.0), task=replace(paper_problem(0.2, 0.0).task, start=np.full(6, 3.0)))
    result = co_design([outside, outside])
    assert result.mean is None
    assert result.projection is None
    assert result.designs == {}
    assert result.comparison.counted == ()


def test_totals_are_over_the_tasks_that_every_method_solved():
    result = compare([1.0, 2.0, None, 4.0], {"a": [1.5, None, None, 5.0], "b": [1.1, 2.2, None, 4.4]})
    assert result.counted == (0, 3)
    assert result.totals == {"own": 5.0, "a": 6.5, "b": 5.5}
    assert result.failed == {"own": (2,), "a": (1, 2), "b": (2,)}
    assert result.regret["a"] == (0.5, None, None, 0.25)
    assert result.total_regret["a"] == pytest.approx(0.3)
    assert result.total_regret["b"] == pytest.approx(0.1)
