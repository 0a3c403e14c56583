"""A choice among local optima: a task solved from several starts, of which the best answer is kept.

The first start is that of the ladder, as for a task that is solved once. Start k = 1, 2, ... is a quintic motion on the
task's own grid, with other motors and more time: every motor's lengths are drawn uniformly within their bounds
and moved to the nearest feasible design (Problem 2), and the shortest time for them is stretched by a factor drawn
from 1 to `SLOWEST`. What is drawn depends on k alone, so every task and every machine has the same starts.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from services.codesign.guess import Guess, quintic_guess, starting_design
from services.codesign.instance import build_instance
from services.codesign.ladder import attempt_once
from services.codesign.problem import Problem
from services.codesign.program import program_of
from services.codesign.reconcile import project_design
from services.codesign.solution import NOT_ATTEMPTED, Solution
from services.codesign.solve import solution_of, solve
from services.codesign.solver import INTERRUPTED, STOPPED, Progress, SolverOptions

SEED = 2017
SLOWEST = 3.0

SAME_END = 1e-3
"""Objectives this close, relative to the best, count as one end: a solve to tol 1e-6 leaves a tenth of it open."""


@dataclass(frozen=True)
class StartRun:
    """What became of one start. The first one's figures are those of all its attempts."""

    status: str
    objective: float | None  # None when it failed
    iterations: int
    seconds: float


@dataclass(frozen=True)
class End:
    """Where some starts ended: an objective and how many came within `SAME_END` of it."""

    objective: float
    starts: int


@dataclass(frozen=True)
class BestOfStarts:
    """The best solution, with the effort of all starts, and what each start gave; no runs where one was asked for."""

    solution: Solution
    runs: tuple[StartRun, ...]


def solve_from_starts(
    problem: Problem,
    starts: int,
    options: SolverOptions,
    progress: Progress | None = None,
    known: Guess | None = None,
) -> BestOfStarts:
    """Solve a problem from `starts` starts, within `options.max_wall_time` all together, and keep the best.

    A `known` point is tried in the first one, before its ladder.

    Where the design and the time are both given the starts are all alike, and only one is tried. A solve that is
    stopped is returned as it is.
    """
    deadline = time.monotonic() + options.max_wall_time
    first = solve(problem, known, options, progress)
    if starts == 1 or first.status in (STOPPED, INTERRUPTED, NOT_ATTEMPTED):
        return BestOfStarts(first, ())
    found = [first]
    for k in range(1, _different_starts(problem, starts)):
        if time.monotonic() > deadline or not first.problem.objective.is_resolved:
            break
        attempts = sum(len(solution.attempts) for solution in found)
        solution = _solve_from(first.problem, k, options, progress=progress, attempts=attempts, deadline=deadline)
        found.append(solution)
        if solution.status in (STOPPED, INTERRUPTED):
            return BestOfStarts(_together(found, k), ())
    runs = tuple(StartRun(s.status, s.objective, s.iterations, s.solve_time) for s in found)
    return BestOfStarts(_together(found, _best(found)), runs)


def ends(runs: Sequence[StartRun]) -> list[End]:
    """Where the starts that succeeded ended, best first."""
    objectives = sorted(run.objective for run in runs if run.objective is not None)
    grouped: list[list[float]] = []
    for objective in objectives:
        if grouped and objective - grouped[-1][0] <= SAME_END * abs(objectives[0]):
            grouped[-1].append(objective)
        else:
            grouped.append([objective])
    return [End(group[0], len(group)) for group in grouped]


def _different_starts(problem: Problem, starts: int) -> int:
    low, high = problem.final_time_bounds
    return 1 if problem.design is not None and low == high else starts


def _solve_from(
    problem: Problem, k: int, options: SolverOptions, *, progress: Progress | None, attempts: int, deadline: float
) -> Solution:
    began = time.perf_counter()
    program = program_of(problem)
    instance = build_instance(problem, program)
    design, stretch = starting_point(problem, k)
    guess = quintic_guess(problem, program, instance, design, stretch)
    result = attempt_once(
        f"start {k}", program, instance, guess, options=options, progress=progress, attempt=attempts, deadline=deadline
    )
    solution = solution_of(problem, program, instance, result)
    return replace(solution, solve_time=time.perf_counter() - began)


def starting_point(problem: Problem, k: int) -> tuple[np.ndarray, float]:
    """Design, (n, 7) [m], and stretch of the motion time of start k = 1, 2, ...; a given design is kept."""
    rng, motor = np.random.default_rng([SEED, k]), problem.motor
    stretch = math.exp(rng.uniform(0, math.log(SLOWEST)))
    if problem.design is not None:
        return problem.design, stretch
    drawn = project_design(rng.uniform(motor.lower, motor.upper, (problem.robot.joints, len(motor.lower))), motor)
    return (drawn.design if drawn.feasible else starting_design(problem)), stretch


def _best(found: Sequence[Solution]) -> int:
    """The start with the least objective; of equal ones, and when all failed, the earliest."""
    objectives = [math.inf if solution.objective is None else solution.objective for solution in found]
    return int(np.argmin(objectives))


def _together(found: Sequence[Solution], kept: int) -> Solution:
    """One of the solutions, with the effort of all."""
    return replace(
        found[kept],
        attempts=tuple(attempt for solution in found for attempt in solution.attempts),
        iterations=sum(solution.iterations for solution in found),
        solve_time=sum(solution.solve_time for solution in found),
    )
