"""The best single design for all tasks: Problem 1 solved as it stands, from the best design known.

The paper averages the tasks' designs because it holds this problem for intractable; with the linear systems
eliminated motion by motion it costs about as much as the two-step process itself (docs/performance.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from services.codesign.guess import Guess, motion_guess
from services.codesign.instance import Instance, build_instance, objective_scale, scales_of
from services.codesign.motion import Motion
from services.codesign.optimality import Optimality, optimality
from services.codesign.problem import Problem
from services.codesign.program import Program, load_program
from services.codesign.shared_program import SharedProgram, build_shared_program
from services.codesign.solver import IterationReport, Progress, SolverOptions, run

_PROGRAMS: dict[tuple[int, int], SharedProgram] = {}


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
    objective: float  # weighted sum of the tasks' objectives
    iterations: int
    solve_time: float  # s
    optimality: Optimality  # residuals of the joint program
    convergence: tuple[tuple[int, float], ...]  # (iteration, weighted sum of the objectives)


def solve_shared(
    problems: Sequence[Problem],
    weights: Sequence[float],
    start: SharedStart,
    options: SolverOptions,
    progress: Progress | None = None,
) -> SharedOptimum:
    """Minimise the weighted sum of the tasks' objectives over all motions and one design  (Problem 1).

    Parameters
    ----------
    problems
        One a task, alike but for their tasks and the references of a weighted objective; the design is free.
    weights
        One a task, > 0; the sum is over ``weight x objective``.
    progress
        Called at every iteration; True stops the solve.
    """
    task = load_program(problems[0].robot, problems[0].layout, problems[0].transcription.intervals)
    program = _shared(task, len(problems))
    parts = [build_instance(problem, task) for problem in problems]
    guess = [
        motion_guess(problem, task, part, start.design, motion).x
        for problem, part, motion in zip(problems, parts, start.motions, strict=True)
    ]
    total = sum(weights)
    weighted = [_weigh(part, weight * len(weights) / total) for part, weight in zip(parts, weights, strict=True)]
    instance = program.instance(weighted)
    unit = objective_scale(problems[0]) * len(weights) / total
    convergence: list[tuple[int, float]] = []

    def watched(report: IterationReport) -> bool:
        convergence.append((report.iteration, report.objective / unit))
        return progress is not None and progress(replace(report, objective=report.objective / unit))

    outcome = run(program, instance, Guess(program.join(guess)), options, progress=watched)
    scaled = outcome.x[: task.design_size].reshape(start.design.shape)
    return SharedOptimum(
        success=outcome.success,
        status=outcome.status,
        design=scaled * scales_of(problems[0]).design if outcome.success else None,
        objective=outcome.objective / unit,
        iterations=outcome.iterations,
        solve_time=outcome.seconds,
        optimality=optimality(program, instance, outcome.x, outcome.lam_x, outcome.lam_g),
        convergence=tuple(convergence),
    )


def _shared(task: Program, tasks: int) -> SharedProgram:
    """Built once per process and number of tasks."""
    key = (id(task), tasks)
    if key not in _PROGRAMS:
        _PROGRAMS[key] = build_shared_program(task, tasks)
    return _PROGRAMS[key]


def _weigh(part: Instance, weight: float) -> Instance:
    """The same numbers with the weights of the objective, the last two parameters, times `weight`."""
    parameters = part.parameters.copy()
    parameters[-2:] *= weight
    return replace(part, parameters=parameters)
