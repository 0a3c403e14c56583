"""Time, energy and the front between them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest

from services.codesign.certify import certify
from services.codesign.guess import starting_design
from services.codesign.problem import Objective, Problem, Transcription
from services.codesign.solve import References, references, solve, with_references
from tests.numerics.tasks import UR5, paper_problem, paper_task, solved

LOCAL = 2e-3
"""Relative distance between neighbouring local optima of the minimum time."""

ALPHAS = (0.2, 0.5, 0.8)


def test_alpha_zero_is_the_minimum_time():
    fastest, weighted = solved(0.6, 2.0), solved(0.6, 2.0, "weighted", 0.0)
    assert weighted.measures.final_time == pytest.approx(fastest.measures.final_time, rel=LOCAL)
    assert weighted.objective == pytest.approx(1.0, rel=LOCAL)


def test_alpha_one_is_effort_alone_and_takes_all_the_time_there_is():
    bounded = Objective("weighted", alpha=1.0, final_time_bounds=(0.05, 1.0))
    slowest = solve(Problem(UR5, paper_task(0.6, 2.0), objective=bounded))
    assert slowest.measures.final_time == pytest.approx(1.0, rel=1e-3)
    assert slowest.measures.effort == pytest.approx(solved(0.6, 2.0, "energy").objective, rel=1e-3)


def test_the_front_is_monotone():
    """More weight on effort: slower and less of it; and no point is better than another in its own weighting."""
    front = [solved(0.6, 2.0, "weighted", alpha) for alpha in ALPHAS]
    times = [point.measures.final_time for point in front]
    efforts = [point.measures.effort for point in front]
    assert all(a < b for a, b in pairwise(times))
    assert all(a > b for a, b in pairwise(efforts))
    for alpha, point in zip(ALPHAS, front, strict=True):
        objective = point.problem.objective
        for time, effort in zip(times, efforts, strict=True):
            value = (1 - alpha) * time / objective.time_reference + alpha * effort / objective.effort_reference
            assert value >= point.objective * (1 - 1e-6)


def test_references_are_the_minimum_time_and_its_effort():
    fastest, solution = solved(0.6, 2.0), solved(0.6, 2.0, "weighted", 0.5)
    assert solution.problem.objective.time_reference == fastest.measures.final_time
    assert solution.problem.objective.effort_reference == fastest.measures.effort
    assert [attempt.name for attempt in solution.attempts] == [
        "references: 12 intervals",
        "references: from 12 intervals",
        "given start",
    ]
    expected = 0.5 + 0.5 * 1.0  # the fastest motion itself
    assert solution.objective < expected


def test_references_of_a_given_design_are_those_of_the_task():
    problem = paper_problem(0.6, 2.0, "weighted", 0.5)
    found, _ = references(replace(problem, design=starting_design(problem)))
    assert found == References(solved(0.6, 2.0).measures.final_time, solved(0.6, 2.0).measures.effort)


def test_given_references_are_kept():
    half = Objective("weighted", alpha=0.5, time_reference=0.4)
    problem = with_references(Problem(UR5, paper_task(0.6, 2.0), objective=half), References(0.3, 5000.0))
    assert (problem.objective.time_reference, problem.objective.effort_reference) == (0.4, 5000.0)
    solution = solve(problem)
    assert len(solution.attempts) == 1
    measures = solution.measures
    expected = 0.5 * measures.final_time / 0.4 + 0.5 * measures.effort / 5000
    assert solution.objective == pytest.approx(expected, rel=1e-12)


def test_more_time_needs_less_effort():
    """MODEL section 1: with t_f free the energy problem has no answer."""
    efforts = []
    for duration in (0.5, 1.0, 2.0):
        problem = Problem(UR5, paper_task(0.6, 2.0, duration), objective=Objective("energy"))
        efforts.append(solve(problem).objective)
    assert efforts[0] > 1.5 * efforts[1] > 1.5 * efforts[2]


def test_references_that_cannot_be_found_fail_the_task():
    problem = Problem(
        UR5, replace(paper_task(0.6, 2.0), start=paper_task(3.0, 0.0).start), objective=Objective("weighted")
    )
    solution = solve(problem)
    assert not solution.success
    assert "range" in solution.reason


@pytest.mark.parametrize("control", ["voltage", "current"])
def test_electrical_energy_is_less_than_that_of_least_effort(control):
    """Each objective wins in its own unit; joules are those of the motion, signed."""
    transcription = Transcription("radau", 1, 20) if control == "voltage" else Transcription("radau", 2, 20, "current")
    least, effort = (
        solve(paper_problem(0.6, 2.0, kind, transcription=transcription)) for kind in ("electrical_energy", "energy")
    )
    assert least.success
    assert least.objective == pytest.approx(least.measures.electrical_energy, rel=1e-12)
    assert least.measures.final_time == pytest.approx(1.0)
    assert least.measures.electrical_energy < 0.9 * effort.measures.electrical_energy
    assert effort.measures.effort < 0.9 * least.measures.effort
    drawn = certify(least).energies.electrical
    assert drawn == pytest.approx(least.objective, rel=2e-2)  # implicit Euler on 20 intervals books 1 percent more


def test_electrical_energy_needs_a_duration():
    problem = Problem(UR5, replace(paper_task(0.6, 2.0), duration=None), objective=Objective("electrical_energy"))
    with pytest.raises(ValueError, match="duration"):
        solve(problem)
