"""The elastic program: its derivatives, and that it names the limits that truly stand in the way, and by how much."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from services.codesign import solver as solver_module
from services.codesign.elastic import (
    KEPT,
    elastic_instance,
    elastic_start,
    limit_sizes,
    load_elastic,
    unmet_limits,
)
from services.codesign.guess import quintic_guess, starting_design
from services.codesign.instance import build_instance
from services.codesign.problem import Objective, Problem, Transcription
from services.codesign.program import load_program
from services.codesign.solve import solve
from services.codesign.solver import MUMPS, STAGED, Outcome, SolverOptions, run
from services.codesign.staged_ldl import load_staged_ldl
from tests.numerics.tasks import UR5, paper_problem, paper_task

COARSE = Transcription(intervals=15)
SHORT = 0.35
"""s: more than the rotor's speed limit asks for 1 rad, less than the fastest motion takes."""


def energy_in(duration: float, **changes) -> Problem:
    return Problem(UR5, paper_task(1.0, 0.0, duration), objective=Objective("energy"), transcription=COARSE, **changes)


def given_shares(problem: Problem) -> np.ndarray:
    shares: np.ndarray = elastic_outcome(problem).x[-len(limit_sizes(problem)) :]
    return shares


def elastic_outcome(problem: Problem) -> Outcome:
    program = load_program(UR5, problem.layout, problem.transcription.intervals)
    instance = build_instance(problem, program)
    elastic = load_elastic(program)
    start = quintic_guess(problem, program, instance, starting_design(problem))
    outcome = run(
        elastic, elastic_instance(problem, elastic, instance), elastic_start(elastic, start.x), SolverOptions()
    )
    assert outcome.success
    return outcome


@pytest.mark.parametrize(
    "transcription",
    [
        COARSE,
        replace(COARSE, scheme="legendre", degree=2),
        replace(COARSE, control="current", degree=3),
    ],
    ids=["paper", "legendre", "current"],
)
def test_our_factorisation_and_mumps_take_the_same_way(transcription, monkeypatch):
    """The order of elimination fits the elastic program: it is not left to MUMPS, which knows of no order."""
    if load_staged_ldl() is None:
        pytest.skip("without a C compiler MUMPS does all the linear algebra: there is nothing to compare")
    problem = replace(energy_in(SHORT), transcription=transcription)
    ours = elastic_outcome(problem)
    monkeypatch.setattr(solver_module, "load_staged_ldl", lambda: None)
    theirs = elastic_outcome(problem)
    assert (ours.linear_solver, theirs.linear_solver) == (STAGED, MUMPS)
    assert ours.objective == pytest.approx(theirs.objective, rel=1e-6)


@lru_cache(maxsize=1)
def shortest() -> float:
    solution = solve(replace(energy_in(SHORT), objective=Objective("time")))
    return solution.objective


def test_a_task_that_can_be_done_asks_nothing_of_its_limits():
    assert given_shares(energy_in(1.0)).max() < KEPT


def test_too_little_time_is_named_with_the_time_that_is_needed():
    (unmet,) = unmet_limits(energy_in(SHORT), given_shares(energy_in(SHORT)))
    assert unmet.share == pytest.approx(shortest() / SHORT - 1, rel=1e-2)
    assert unmet.words == f"the motion takes {SHORT * (1 + unmet.share):.4g} s, {SHORT} s are allowed"


def test_the_reason_of_a_failed_solve_says_it():
    solution = solve(energy_in(SHORT))
    assert not solution.success
    assert solution.attempts[-1].name == "elastic limits"
    assert solution.attempts[-1].status == "Solve_Succeeded"
    assert "asks least of the limits breaks these: the motion takes 0.40" in solution.reason
    assert f"{SHORT} s are allowed" in solution.reason


def test_motors_too_weak_are_named_with_the_current_they_need():
    """With that current allowed, the same motors do the task; with a little less they do not."""
    weak = solve(paper_problem(1.0, 4.0, "energy", transcription=COARSE)).design
    problem = paper_problem(0.2, 4.0, "energy", transcription=COARSE, design=weak)
    (unmet,) = unmet_limits(problem, given_shares(problem))
    assert unmet.words.startswith("motor 2 takes 3.")
    assert "A, 3 A are allowed" in unmet.words

    def allowed(current: float) -> bool:
        return solve(replace(problem, motor=replace(problem.motor, current_limit=current))).success

    assert allowed(3.0 * (1 + 1.02 * unmet.share))
    assert not allowed(3.0 * (1 + 0.9 * unmet.share))


@pytest.mark.parametrize("control", ["voltage", "current"])
def test_derivatives_are_those_of_the_values(control):
    """Central differences along random directions."""
    transcription = replace(COARSE, control=control, degree=1 if control == "voltage" else 3)
    problem = replace(energy_in(SHORT), transcription=transcription)
    program = load_program(UR5, problem.layout, 15)
    instance, elastic = build_instance(problem, program), load_elastic(program)
    p = elastic_instance(problem, elastic, instance).parameters
    rng = np.random.default_rng(0)
    z = elastic_start(elastic, quintic_guess(problem, program, instance, starting_design(problem)).x).x
    direction, lam = rng.standard_normal(elastic.variables), rng.standard_normal(elastic.constraints)
    step = 1e-6

    def difference(values):
        ends = [np.array(values(z + sign * step * direction)).ravel() for sign in (1, -1)]
        return (ends[0] - ends[1]) / (2 * step)

    jacobian = elastic.jac_g(z, p)[1].sparse()
    assert jacobian @ direction == pytest.approx(difference(lambda x: elastic.nlp(x, p)[1]), rel=1e-4, abs=1e-4)
    upper = elastic.hess_lag(z, p, 1.0, lam).sparse()
    hessian = upper + upper.T - np.diag(upper.diagonal())
    slope = difference(lambda x: elastic.jac_g(x, p)[1].sparse().T @ lam)
    assert np.asarray(hessian @ direction).ravel() == pytest.approx(slope, rel=1e-3, abs=1e-2)


def test_limits_are_put_in_words():
    problem, n = energy_in(SHORT), UR5.joints
    shares = np.zeros(len(limit_sizes(problem)))
    for limit, share in (
        (0, 0.1),
        (n + 1, 0.2),
        (2 * n + 2, 0.3),
        (3 * n + 3, 0.4),
        (4 * n, 0.5),
        (4 * n + 1 + 6, 0.6),
    ):
        shares[limit] = share
    words = [unmet.words for unmet in unmet_limits(problem, shares)][::-1]
    half = (UR5.joint_upper[0] - UR5.joint_lower[0]) / 2
    assert words[0] == f"joint 1 leaves its range by {0.1 * half:.3g} rad"
    assert words[1] == "joint 2 turns at 3.77 rad/s, 3.142 rad/s are allowed"
    assert words[2] == "motor 3 takes 3.9 A, 3 A are allowed"
    assert words[3] == "motor 4 takes 140 V, 100 V are allowed"
    assert words[4] == "the motion takes 0.525 s, 0.35 s are allowed"
    assert words[5].startswith("motor 2 has ")
