"""The paper from end to end, in this process and one solve after the other  (Section III-A, Fig. 2; Section IV).

The service runs the same pieces, one solve a job.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from services.codesign.comparison import Comparison, compare
from services.codesign.problem import Problem
from services.codesign.reconcile import Projection, mean_design, project_design
from services.codesign.solve import Solution, SolverOptions, solve

TWO_STEP = "two_step"
EMPIRICAL = "empirical"
WORST_CASE = "worst_case"


@dataclass(frozen=True)
class CoDesign:
    """What the pipeline returns. Lists run over the tasks; `motions` is by method."""

    own: tuple[Solution, ...]  # each task with a design of its own
    mean: np.ndarray | None  # (n, 7) m, over the solved tasks; None when none was solved
    projection: Projection | None  # Problem 2
    designs: Mapping[str, np.ndarray]  # by method, (n, 7) m; a method whose design failed is missing
    motions: Mapping[str, tuple[Solution | None, ...]]  # None for a task without a solution of its own
    comparison: Comparison


def co_design(
    problems: Sequence[Problem],
    weights: Sequence[float] | None = None,
    empirical_task: int | None = None,
    worst_case_task: int | None = None,
    options: SolverOptions | None = None,
) -> CoDesign:
    """Design the motors for all tasks by the two-step process, and compare with the designs of single tasks.

    Parameters
    ----------
    problems
        One a task, the design free, all of one robot, motor and objective.
    weights
        How often each task occurs, for the mean; equal, as in the paper, when None.
    empirical_task, worst_case_task
        Tasks whose own design is applied to all; by default the middle and the last, as in the paper's grid.
    """
    options = SolverOptions() if options is None else options
    empirical_task = len(problems) // 2 if empirical_task is None else empirical_task
    worst_case_task = len(problems) - 1 if worst_case_task is None else worst_case_task

    own = tuple(solve(problem, options=options) for problem in problems)  # step 1: Problem 1 with n = 1
    mean = mean_of_solved(own, weights)
    projection = None if mean is None else project_design(mean, problems[0].motor)  # Problem 2
    candidates = {
        TWO_STEP: projection.design if projection is not None and projection.feasible else None,
        EMPIRICAL: own[empirical_task].design,
        WORST_CASE: own[worst_case_task].design,
    }
    designs = {name: design for name, design in candidates.items() if design is not None}
    motions = {  # step 2: the motions with the one design
        name: tuple(solve(with_design(task, design), options=options) if task.success else None for task in own)
        for name, design in designs.items()
    }
    values = {name: [None if s is None else s.objective for s in solutions] for name, solutions in motions.items()}
    return CoDesign(own, mean, projection, designs, motions, compare([task.objective for task in own], values))


def mean_of_solved(own: Sequence[Solution], weights: Sequence[float] | None = None) -> np.ndarray | None:
    """Mean of the designs of the tasks that were solved, (n, 7) m; a failed task has no part in it. None without any.

    None as well when every solved task has weight zero.
    """
    shares = np.ones(len(own)) if weights is None else np.asarray(weights, dtype=float)
    solved = [(s.design, share) for s, share in zip(own, shares, strict=True) if s.design is not None and share > 0]
    if not solved:
        return None
    designs, kept = zip(*solved, strict=True)
    return mean_design(designs, kept)


def with_design(own: Solution, design: np.ndarray) -> Problem:
    """The same task with given motors, (n, 7) m, measured by the same references.

    It is solved from the ladder's start, not from the task's own motion: over 25 tasks and three designs the quintic
    guess took a third fewer iterations for `time` and `weighted`, and where one start failed for `energy` so did the
    other.
    """
    return replace(own.problem, design=design)
