"""Accuracy on request: what is refined where, until the replay keeps it, and when that ends."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from services.codesign import accuracy as accuracy_module
from services.codesign.accuracy import MOST_INTERVALS, refined, solve_accurately
from services.codesign.certify import Certificate, Growth, LimitCheck, certify
from services.codesign.problem import FIRST, Accuracy, Problem, Transcription
from services.codesign.solve import SolverOptions, solve
from services.codesign.solver import OUT_OF_TIME, STOPPED
from services.codesign.voltage_law import VoltageLaw
from services.jobs.certificates import missed
from tests.numerics.tasks import UR5, paper_problem, paper_task, solved


def certificate_with(growth: Growth, position: float = 0.0, speed: float = 0.0) -> Certificate:
    law = VoltageLaw(np.array([0.0, 1.0]), np.zeros((1, 1, 1)), np.zeros((1, 1, 1)))
    checks = {"current": LimitCheck(0.0, float(growth.excess.max()))}
    return Certificate(position, speed, 0.0, 0.0, checks, None, None, None, None, 0.0, 0.0, law, growth)


def test_intervals_to_blame_are_halved():
    excess = np.zeros(50)
    excess[[7, 30]] = 0.5, 0.2
    drift = np.zeros(50)
    drift[:8] = 1e-12 * np.arange(8)  # of no weight: the replay ends well
    finer = refined(FIRST, certificate_with(Growth(drift, drift, excess)), Accuracy())
    assert (finer.intervals, finer.degree) == (60, 3)  # a round number; the worst of the others make it up
    assert finer.shares.sum() == pytest.approx(1)
    halves = np.flatnonzero(finer.shares < 0.015)
    assert len(halves) == 20
    starts = np.cumsum(finer.shares) - finer.shares
    for k in (7, 30):
        assert np.isclose(starts[halves], k / 50).any(), "an interval to blame was not halved"


def test_the_degree_rises_where_most_are_to_blame():
    growth = Growth(np.full(50, 1e-3), np.zeros(50), np.zeros(50))
    finer = refined(FIRST, certificate_with(growth, position=0.05), Accuracy())
    assert (finer.intervals, finer.degree) == (50, 4)
    most = replace(FIRST, degree=5)
    assert refined(most, certificate_with(growth, position=0.05), Accuracy()).intervals == 100
    capped = replace(most, intervals=MOST_INTERVALS)
    growth = Growth(np.full(MOST_INTERVALS, 1e-3), np.zeros(MOST_INTERVALS), np.zeros(MOST_INTERVALS))
    assert refined(capped, certificate_with(growth, position=0.05), Accuracy()) is None


def test_a_coarse_start_is_refined_until_it_keeps_the_accuracy():
    first = Transcription("radau", 2, 20, "current")
    accuracy = Accuracy(position=1e-4, speed=1e-3, limit=1e-3)
    seen: list[int] = []
    found = solve_accurately(
        paper_problem(0.4, 1.0), accuracy, SolverOptions(), lambda report: bool(seen.append(report.attempt)), first
    )
    assert found.met
    assert found.certificate.meets(accuracy)
    assert not found.rounds[0].certificate.meets(accuracy)
    assert [step.transcription.intervals for step in found.rounds][:1] == [20]
    assert found.solution.problem.transcription == found.rounds[-1].transcription
    names = [attempt.name for attempt in found.solution.attempts]
    assert names[0] == "quintic"
    assert names[-1].endswith("given start"), "a refined solve starts from the motion before it"
    assert found.solution.iterations == sum(attempt.iterations for attempt in found.solution.attempts)
    assert list(dict.fromkeys(seen)) == list(range(len(names))), "attempts are numbered on over all solves"


def test_a_task_that_cannot_be_solved_has_no_rounds():
    problem = Problem(UR5, replace(paper_task(0.4, 1.0), start=np.full(6, 9.0)))
    found = solve_accurately(problem, Accuracy(), SolverOptions())
    assert (found.met, found.rounds, found.certificate) == (False, (), None)


def test_default_transcription_keeps_the_default_accuracy():
    """The paper's middle task. All 25: `python -m benchmarks.accuracy`."""
    certificate = certify(solve(replace(paper_problem(0.6, 2.0), transcription=FIRST)))
    assert certificate.meets(Accuracy())
    assert not certify(solved(0.6, 2.0)).meets(Accuracy())


def test_an_open_energy_balance_is_not_trusted(monkeypatch):
    """A replay that loses a thousandth of the shaft's work fails the motion, and no finer grid is tried."""
    certificate = certify(solve(replace(paper_problem(0.6, 2.0), transcription=FIRST)))
    lossy = replace(certificate.mechanical_balance, residual=1e-3 * certificate.energies.shaft)
    monkeypatch.setattr(accuracy_module, "certify", lambda _: replace(certificate, mechanical_balance=lossy))
    found = solve_accurately(paper_problem(0.6, 2.0), Accuracy(), SolverOptions())
    assert certificate.balanced
    assert (found.met, len(found.rounds)) == (False, 1)
    assert "left in the mechanical balance (1e-06 of it allowed)" in missed(found, Accuracy())


def test_a_stop_during_a_refinement_is_a_stop():
    """Not a missed accuracy: the caller asked for it."""
    first, seen = Transcription("radau", 2, 20, "current"), []

    def stop_the_second_solve(report):
        seen.append(report.iteration)
        return seen.count(0) == 2

    accuracy = Accuracy(position=1e-4, speed=1e-3)
    found = solve_accurately(paper_problem(0.4, 1.0), accuracy, SolverOptions(), stop_the_second_solve, first)
    assert found.solution.status == STOPPED
    assert (found.met, found.rounds) == (False, ())


def test_a_refinement_has_the_time_that_is_left(monkeypatch):
    """A clock that stands still but for what is said here: the first solve and its replay take 90 s of 100."""
    now = [time.monotonic()]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    refinements = []

    def replayed(solution):
        now[0] += 90.0
        return certify(solution)

    def refining(report):
        if now[0] > start:
            refinements.append(report.iteration)
            now[0] += 4.0

    start = now[0]
    monkeypatch.setattr(accuracy_module, "certify", replayed)
    statuses = []
    monkeypatch.setattr(accuracy_module, "solve", lambda *a: statuses.append((found := solve(*a)).status) or found)
    first, accuracy = Transcription("radau", 2, 20, "current"), Accuracy(position=1e-4, speed=1e-3, limit=1e-3)
    found = solve_accurately(paper_problem(0.4, 1.0), accuracy, SolverOptions(max_wall_time=100.0), refining, first)
    assert statuses == [OUT_OF_TIME]
    assert refinements == [0, 1, 2]
    assert (found.met, len(found.rounds)) == (False, 1)
    assert found.solution.success, "the motion from before is kept"
