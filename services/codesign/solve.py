"""Solve one task: its motion and motors together (Problem 1 with n = 1), or its motion with given motors."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from services.codesign.diagnose import explain_failure, impossible
from services.codesign.guess import Guess
from services.codesign.instance import Instance, build_instance, objective_scale, objective_weights, scales_of
from services.codesign.interrupts import interrupts_kept
from services.codesign.ladder import Climb, climb
from services.codesign.measures import measure
from services.codesign.motion import read_motion, with_gears_of
from services.codesign.optimality import optimality
from services.codesign.problem import Objective, Problem
from services.codesign.program import Program, program_of
from services.codesign.solution import NOT_ATTEMPTED, Attempt, Solution, Start
from services.codesign.solver import IterationReport, Outcome, Progress, SolverOptions, counted_from
from services.codesign.tie_break import break_tie

__all__ = [
    "Attempt",
    "IterationReport",
    "Progress",
    "References",
    "Solution",
    "SolverOptions",
    "Start",
    "references",
    "solution_of",
    "solve",
    "with_references",
]

DEFAULT_OPTIONS = SolverOptions()


def solve(
    problem: Problem,
    start: Guess | Start | None = None,
    options: SolverOptions = DEFAULT_OPTIONS,
    progress: Progress | None = None,
) -> Solution:
    """Solve a problem, trying again along the ladder of `ladder.py`.

    Parameters
    ----------
    problem
        With `design` given only the motion is sought. A weighted objective without references gets them from a
        `time` solve first, whose motion is then the start.
    start
        A point of the program, or a known motion; tried before the ladder.
    progress
        Called at every iteration of every attempt; True stops the solve with status ``User_Requested_Stop``.

    Returns
    -------
    Solution
        Always: a solve that fails is a value with IPOPT's status and a reason.

    Raises
    ------
    ValueError
        For a problem without meaning (energy without a duration).
    BaseException
        Only what `progress` raised, and KeyboardInterrupt at Ctrl-C.
    """
    began = time.perf_counter()
    with interrupts_kept():
        solution = _solve(problem, start, options, progress)
    return replace(solution, solve_time=time.perf_counter() - began)


def _solve(
    problem: Problem, start: Guess | Start | None, options: SolverOptions, progress: Progress | None
) -> Solution:
    obstacle = impossible(problem)
    if obstacle is not None:
        return _not_attempted(problem, obstacle)
    if not problem.objective.is_resolved:
        return _solve_with_references(problem, start, options, progress)
    program = program_of(problem)
    instance = build_instance(problem, program)
    ends = time.monotonic() + options.max_wall_time
    result = climb(problem, program, instance, start, options=options, progress=progress)
    if result.outcome.success and problem.design is None:
        left = replace(options, max_wall_time=ends - time.monotonic())
        result = break_tie(problem, program, instance, result, options=left, progress=progress)
    solution = solution_of(problem, program, instance, result)
    if solution.success:
        return solution
    reason = explain_failure(problem, program, instance, result, options=options, progress=progress, deadline=ends)
    return replace(solution, reason=reason)


@dataclass(frozen=True)
class References:
    """What the parts of a weighted objective are measured by."""

    time: float  # s
    effort: float  # V2 s


def references(
    problem: Problem, options: SolverOptions = DEFAULT_OPTIONS, progress: Progress | None = None
) -> tuple[References | None, Solution]:
    """The task's own minimum time and the integral of u'u of that motion, with the solve they come from.

    The design is left free even when the problem gives one, so that motions with different motors are measured by
    the same references. None when the task cannot be solved for time.
    """
    objective = Objective("time", final_time_bounds=problem.objective.final_time_bounds)
    fastest = solve(replace(problem, objective=objective, design=None, tie_break=None), None, options, progress)
    if fastest.measures is None:
        return None, fastest
    return References(fastest.measures.final_time, fastest.measures.effort), fastest


def with_references(problem: Problem, found: References) -> Problem:
    """The same problem with the references that it leaves open filled in."""
    objective = problem.objective
    return replace(
        problem,
        objective=replace(
            objective,
            time_reference=found.time if objective.time_reference is None else objective.time_reference,
            effort_reference=found.effort if objective.effort_reference is None else objective.effort_reference,
        ),
    )


def _solve_with_references(
    problem: Problem, start: Guess | Start | None, options: SolverOptions, progress: Progress | None
) -> Solution:
    found, fastest = references(problem, options, progress)
    if found is None:
        return replace(fastest, problem=problem)
    later = counted_from(len(fastest.attempts), progress)
    solution = solve(with_references(problem, found), fastest.start if start is None else start, options, later)
    earlier = tuple(replace(attempt, name=f"references: {attempt.name}") for attempt in fastest.attempts)
    return replace(
        solution,
        attempts=earlier + solution.attempts,
        iterations=fastest.iterations + solution.iterations,
    )


def solution_of(problem: Problem, program: Program, instance: Instance, result: Climb) -> Solution:
    """What a climb came to, in physical units; without a reason when it failed."""
    outcome = result.outcome
    certificate = optimality(program, instance, outcome.x, outcome.lam_x, outcome.lam_g)
    solution = Solution(
        problem=problem,
        success=outcome.success,
        status=outcome.status,
        reason=None,
        design=None,
        motion=None,
        measures=None,
        objective=None,
        iterations=sum(attempt.iterations for attempt in result.attempts),
        solve_time=sum(attempt.seconds for attempt in result.attempts),
        attempts=result.attempts,
        kkt_residual=certificate.kkt_residual,
        constraint_violation=certificate.constraint_violation,
        x=outcome.x,
        lam_x=outcome.lam_x,
        lam_g=outcome.lam_g,
    )
    if not outcome.success:
        return solution
    problem, x, lam_x = _with_its_gears(problem, program, outcome)
    scaled, _, _ = program.split(x)
    design = scaled * scales_of(problem).design if problem.design is None else problem.design
    motion = read_motion(problem, program, x)
    measures = measure(problem, design, motion)
    time_weight, effort_weight = objective_weights(problem)
    added_up = measures.electrical_energy if problem.objective.kind == "electrical_energy" else measures.effort
    scaled_objective = time_weight * measures.final_time + effort_weight * added_up
    objective = scaled_objective / objective_scale(problem)
    return replace(
        solution,
        problem=problem,
        design=design,
        motion=motion,
        measures=measures,
        objective=objective,
        x=x,
        lam_x=lam_x,
    )


def _with_its_gears(problem: Problem, program: Program, outcome: Outcome) -> tuple[Problem, np.ndarray, np.ndarray]:
    """Problem, x and lam_x with the gear ratios found as the robot's: all of them over the robot's are 1.

    Nothing else of the point changes, for the program's scales follow the gears (`interval.geared`).
    """
    gears = slice(program.lengths, program.design_size)
    x, lam_x = outcome.x.copy(), outcome.lam_x.copy()
    lam_x[gears] *= x[gears]
    x[gears] = 1.0
    return with_gears_of(problem, program, outcome.x), x, lam_x


def _not_attempted(problem: Problem, reason: str) -> Solution:
    return Solution(
        problem=problem,
        success=False,
        status=NOT_ATTEMPTED,
        reason=reason,
        design=None,
        motion=None,
        measures=None,
        objective=None,
        iterations=0,
        solve_time=0.0,
        attempts=(),
        kkt_residual=math.nan,
        constraint_violation=math.nan,
        x=None,
        lam_x=None,
        lam_g=None,
    )
