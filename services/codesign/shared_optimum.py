"""The best single design for all tasks: Problem 1 solved as it stands, from the best design known.

The paper averages the tasks' designs because it holds this problem for intractable; with the linear systems
eliminated motion by motion it costs about as much as the two-step process itself (docs/performance.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from services.codesign.comparison import over_tasks
from services.codesign.guess import Guess, MotionPoint, motion_guess
from services.codesign.instance import build_instance, objective_scale, scales_of
from services.codesign.kept import Kept
from services.codesign.limits import LimitSlope, binding, design_slopes
from services.codesign.motion import Motion, with_gears_of
from services.codesign.optimality import Optimality, optimality
from services.codesign.problem import Problem
from services.codesign.program import Program, program_of
from services.codesign.shared_program import SharedProgram, build_shared_program
from services.codesign.solver import IterationReport, Outcome, Progress, SolverOptions, run
from services.codesign.tie_break import preferred

_PROGRAMS: Kept[SharedProgram] = Kept(2)

WORST_ALONE = 0.999
"""Share of the worst task when nothing else is asked for: the rest decides among designs that are equal there, and
keeps the motions of the other tasks from being arbitrary."""


@dataclass(frozen=True)
class SharedStart:
    """The best design known, and motions near it, one a task, on any grid."""

    design: np.ndarray  # (n, 7) m
    motions: Sequence[Motion]


@dataclass(frozen=True)
class SharedOptimum:
    """The answer, or how the solve failed; `design` is None then."""

    success: bool
    status: str  # IPOPT's
    design: np.ndarray | None  # (n, 7) m
    reached: np.ndarray  # (n, 7) m, where the solver stood at its end; the motors' constraints may not hold there
    gear_ratio: np.ndarray  # (n,), where the solver stood: those found where they are free, else the robot's
    objective: float  # of the whole: `comparison.over_tasks`
    iterations: int
    solve_time: float  # s
    optimality: Optimality  # residuals of the joint program, at its optimum
    convergence: tuple[tuple[int, float], ...]  # (iteration, objective)
    deciding: tuple[float, ...] = ()  # how much each task decides about the worst one's objective, sum 1; () without
    design_limits: Mapping[str, LimitSlope] = field(default_factory=dict)  # that hold the design back, by name
    motions: tuple[MotionPoint, ...] = ()  # at an optimum, one a task


def solve_shared(
    problems: Sequence[Problem],
    weights: Sequence[float],
    start: SharedStart,
    options: SolverOptions,
    progress: Progress | None = None,
    *,
    worst_share: float = 0.0,
) -> SharedOptimum:
    """Minimise over all motions and one design  (Problem 1).

    Parameters
    ----------
    problems
        One a task, alike but for their tasks and the references of a weighted objective; the design is free. The
        robot's gear ratios are where free ones begin.
    weights
        One a task, > 0; the sum is over ``weight x objective``.
    progress
        Called at every iteration; True stops the solve.
    worst_share
        0: the weighted sum; 1: the worst task's objective; between: a mix (`comparison.over_tasks`).
    """
    task = program_of(problems[0])
    program = _shared(task, len(problems), worst_share > 0, options.threads)
    parts = [build_instance(problem, task) for problem in problems]
    guess = [
        motion_guess(problem, task, part, start.design, motion).x
        for problem, part, motion in zip(problems, parts, start.motions, strict=True)
    ]
    unit = objective_scale(problems[0]) * len(weights) / sum(weights)
    shares, worst_weight = _weights(weights, worst_share)
    instance = program.instance(parts, shares, worst_weight)
    convergence: list[tuple[int, float]] = []

    def watched(report: IterationReport) -> bool:
        convergence.append((report.iteration, report.objective / unit))
        return progress is not None and progress(replace(report, objective=report.objective / unit))

    worst = max(float(task.nlp(x, part.parameters)[0]) for x, part in zip(guess, parts, strict=True))
    outcome = run(program, instance, Guess(program.join(guess, worst)), options, progress=watched)
    certificate = optimality(program, instance, outcome.x, outcome.lam_x, outcome.lam_g)
    if outcome.success and problems[0].tie_break is not None:
        at = outcome.objective / unit
        as_found = None if progress is None else lambda report: progress(replace(report, objective=at))
        tried = preferred(problems[0], program, instance, outcome, options=options, progress=as_found)
        outcome = tried if tried.success else outcome
    scaled, _, _ = task.split(outcome.x[program.variables_of(0)])
    reached = scaled * scales_of(problems[0]).design
    lam_motors = outcome.lam_g[program.constraints_of(0)[task.intervals * task.interval_constraints :]]
    found = [outcome.x[program.variables_of(k)] for k in range(len(problems))]
    values = [float(task.nlp(x, part.parameters)[0]) for x, part in zip(found, parts, strict=True)]
    objective = over_tasks(values, weights, worst_share) / objective_scale(problems[0])
    design_limits = design_slopes(problems[0].motor, outcome.lam_x[: task.lengths] / unit, lam_motors / unit)
    return SharedOptimum(
        success=outcome.success,
        status=outcome.status,
        design=reached if outcome.success else None,
        reached=reached,
        gear_ratio=with_gears_of(problems[0], task, outcome.x).robot.gear_ratio,
        objective=objective,
        iterations=outcome.iterations,
        solve_time=outcome.seconds,
        optimality=certificate,
        convergence=tuple(convergence),
        deciding=_deciding(outcome.lam_g[program.worst_rows]),
        design_limits=binding(design_limits, objective),
        motions=tuple(_motions(program, outcome, shares)) if outcome.success else (),
    )


def _motions(program: SharedProgram, outcome: Outcome, shares: Sequence[float]) -> Iterator[MotionPoint]:
    """Each task's motion, with the multipliers that it has in the task's own program.

    The joint program counts a task's objective with its share and the multiplier that holds it below the worst one;
    its multipliers over these are the task's own.
    """
    task = program.task
    of_worst = outcome.lam_g[program.worst_rows] if program.has_worst else np.zeros(program.tasks)
    for k, weight in enumerate(shares + of_worst):
        motion = program.variables_of(k)[task.design_size :]
        constraints = program.constraints_of(k)[: task.intervals * task.interval_constraints]
        yield MotionPoint(outcome.x[motion], outcome.lam_x[motion] / weight, outcome.lam_g[constraints] / weight)


def _weights(weights: Sequence[float], worst_share: float) -> tuple[list[float], float]:
    """Weights of the tasks' objectives and of the worst one in the program: of mean one, so that it is well scaled."""
    share = min(worst_share, WORST_ALONE)
    mean = sum(weights) / len(weights)
    return [(1 - share) * weight / mean for weight in weights], share * len(weights)


def _deciding(multipliers: np.ndarray) -> tuple[float, ...]:
    """At an optimum the multipliers of f_k <= z add up to the weight of z."""
    return tuple((multipliers / multipliers.sum()).tolist()) if len(multipliers) else ()


def _shared(task: Program, tasks: int, has_worst: bool, threads: int) -> SharedProgram:
    """Kept in the process, by kind."""
    key = (id(task), tasks, has_worst, threads)
    return _PROGRAMS.get(key, lambda: build_shared_program(task, tasks, has_worst=has_worst, threads=threads))
