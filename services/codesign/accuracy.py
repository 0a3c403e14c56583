"""Accuracy on request: solve, replay, and refine where the error sits, until the motion keeps what was asked for.

Currents are the control: the voltages that follow can be replayed (MODEL section 5), and the minimum time settles at
first order: departure 12 (docs/model.md). Where few intervals are to blame they are halved (h); where most are, the
degree rises (p). Each solve starts from the motion before it.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from services.codesign.certify import Certificate, certify
from services.codesign.collocation import DEGREES
from services.codesign.guess import Guess
from services.codesign.problem import FIRST, Accuracy, Problem, Transcription
from services.codesign.solve import Progress, Solution, SolverOptions, solve
from services.codesign.solver import INTERRUPTED, STOPPED, counted_from
from services.codesign.starts import StartRun, solve_from_starts

MOST_REFINEMENTS = 4
MOST_INTERVALS = 200

MANY = 0.5
"""Share of the intervals above which the degree rises instead."""

ROUND_TO = 10
"""Intervals come in tens, so that programs are shared between tasks; the worst of the others make up the number."""


@dataclass(frozen=True)
class Round:
    """One solve on the way, and what its replay found."""

    transcription: Transcription
    certificate: Certificate


@dataclass(frozen=True)
class AccurateSolution:
    """The last motion that was solved, with the way to it.

    `rounds` is empty when the first solve failed or any was stopped.
    """

    solution: Solution
    rounds: tuple[Round, ...]
    met: bool
    starts: tuple[StartRun, ...] = ()  # of the first solve, when several were asked for

    @property
    def certificate(self) -> Certificate | None:
        """Of the motion; None when there is none."""
        return self.rounds[-1].certificate if self.rounds else None


def solve_accurately(
    problem: Problem,
    accuracy: Accuracy,
    options: SolverOptions,
    progress: Progress | None = None,
    first: Transcription = FIRST,
    *,
    starts: int = 1,
    known: Guess | None = None,
) -> AccurateSolution:
    """Solve a problem so that its replay meets `accuracy`; the problem's own transcription is not looked at.

    An energy balance of the replay that stays open fails the motion too, but a finer grid would not close it. When the
    accuracy cannot be reached within `MOST_REFINEMENTS` solves and `MOST_INTERVALS` intervals, or a refined solve
    fails, the last motion is returned with `met` false. A solve that is stopped is returned as it is, without rounds.
    With several `starts` the best of the first solve's is refined (`starts.py`), which may begin at a `known` point.

    A tie-break spends what an optimum has to spare, and may leave no grid on which its motion keeps the accuracy. Then
    the problem is solved again without it.
    """
    ends = time.monotonic() + options.max_wall_time
    found = _solve_and_refine(problem, accuracy, options, progress, first, starts=starts, known=known)
    left = ends - time.monotonic()
    if found.met or not found.rounds or problem.tie_break is None or left <= 0:
        return found
    plain, options = replace(problem, tie_break=None), replace(options, max_wall_time=left)
    later = counted_from(len(found.solution.attempts), progress)
    without = _solve_and_refine(plain, accuracy, options, later, first, starts=starts, known=known)
    both = _after(found.solution, without.solution, "without the tie-break")
    if without.met or without.solution.status in (STOPPED, INTERRUPTED):
        return replace(without, solution=both)
    told = replace(found.solution, attempts=both.attempts, iterations=both.iterations, solve_time=both.solve_time)
    return replace(found, solution=told)


def _solve_and_refine(
    problem: Problem,
    accuracy: Accuracy,
    options: SolverOptions,
    progress: Progress | None,
    first: Transcription,
    *,
    starts: int,
    known: Guess | None,
) -> AccurateSolution:
    deadline = time.monotonic() + options.max_wall_time
    best = solve_from_starts(replace(problem, transcription=first), starts, options, progress, known)
    solution = best.solution
    if not solution.success:
        return AccurateSolution(solution, (), met=False)
    rounds = [Round(first, certify(solution))]
    while not rounds[-1].certificate.keeps(accuracy) and len(rounds) <= MOST_REFINEMENTS:
        finer = refined(solution.problem.transcription, rounds[-1].certificate, accuracy)
        left = deadline - time.monotonic()
        if finer is None or left <= 0:
            break
        finer_problem, within = replace(solution.problem, transcription=finer), replace(options, max_wall_time=left)
        found = solve(finer_problem, solution.start, within, counted_from(len(solution.attempts), progress))
        name = f"refined to {finer.intervals} intervals of degree {finer.degree}"
        if found.status in (STOPPED, INTERRUPTED):
            return AccurateSolution(_after(solution, found, name), (), met=False)
        if not found.success:
            break
        solution = _after(solution, found, name)
        rounds.append(Round(finer, certify(found)))
    return AccurateSolution(solution, tuple(rounds), rounds[-1].certificate.meets(accuracy), best.runs)


def refined(transcription: Transcription, certificate: Certificate, accuracy: Accuracy) -> Transcription | None:
    """The next transcription, finer where the replay left the motion or a limit; None when the caps are reached."""
    to_blame = _to_blame(transcription, certificate, accuracy)
    if (to_blame > 1).mean() > MANY and transcription.degree < DEGREES[-1]:
        return replace(transcription, degree=transcription.degree + 1)
    N = transcription.intervals
    count = min(-(-(N + int((to_blame > 1).sum())) // ROUND_TO) * ROUND_TO, MOST_INTERVALS, 2 * N)
    if count <= N:
        return None if transcription.degree == DEGREES[-1] else replace(transcription, degree=transcription.degree + 1)
    halved = np.zeros(N, dtype=bool)
    halved[np.argsort(-to_blame, kind="stable")[: count - N]] = True
    widths = np.repeat(transcription.shares / (1 + halved), 1 + halved)
    return replace(transcription, intervals=count, widths=tuple((widths / widths.sum()).tolist()))


def _to_blame(transcription: Transcription, certificate: Certificate, accuracy: Accuracy) -> np.ndarray:
    """Error of each interval over its fair part of the tolerance, shape (N,)."""
    growth = certificate.growth
    if growth is None:
        return np.full(transcription.intervals, np.inf)
    part = 1 / transcription.intervals
    drift = np.maximum(growth.position / (part * accuracy.position), growth.speed / (part * accuracy.speed))
    ends_well = (
        certificate.replay_position is not None
        and certificate.replay_speed is not None
        and (certificate.replay_position <= accuracy.position and certificate.replay_speed <= accuracy.speed)
    )
    # Drift that cancels until the end is nobody's fault; what exceeds a limit on the way is.
    excess = growth.excess / accuracy.limit
    blame: np.ndarray = excess if ends_well else np.maximum(drift, excess)
    return blame


def _after(earlier: Solution, later: Solution, name: str) -> Solution:
    """The later solution with the effort of both; its attempts are named after what it was."""
    renamed = tuple(replace(attempt, name=f"{name}: {attempt.name}") for attempt in later.attempts)
    return replace(
        later,
        attempts=earlier.attempts + renamed,
        iterations=earlier.iterations + later.iterations,
        solve_time=earlier.solve_time + later.solve_time,
    )
