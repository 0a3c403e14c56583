"""The job that finds the best single design for all tasks, and never hands on one that is worse than it found.

A search that is asked to end, or runs out of time or iterations, hands on the design at which it stood if the tasks,
solved with it, confirm that it is better.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from services.codesign.problem import Problem
from services.codesign.reconcile import project_design
from services.codesign.shared_optimum import SharedOptimum, solve_shared
from services.codesign.solve import solve, with_references
from services.codesign.solver import STOPPED, IterationReport, Progress, SolverOptions
from services.jobs.arrays import pack_points
from services.jobs.certificates import finite
from services.jobs.design_wire import design_wire
from services.jobs.finish import Outcome
from services.jobs.limit_costs import limits_wire
from services.jobs.resolved import SHARED
from services.jobs.snap_design import snapped_designs
from services.jobs.work import SharedInputs, Work
from shared.domain import JobState

MOST_CONVERGENCE_POINTS = 1000

LEAST_SHARE = 1e-3
"""A task that decides less than this about the worst one's objective does not decide: the barrier leaves a trace."""


def find_shared_optimum(
    work: Work, options: SolverOptions, progress: Progress, search_stopped: Callable[[], bool]
) -> Outcome:
    """Solve Problem 1 from the best design known; where that is not improved upon, it stays.

    Parameters
    ----------
    progress
        Called at every iteration, also of the tasks' solves; True cancels.
    search_stopped
        Whether to end the search with the best design so far.
    """
    inputs, motor = work.shared, work.application.build_motor()
    if inputs is None:
        return Outcome(JobState.FAILED, "there is no design to start from")
    weights = [work.application.tasks[k].weight for k in inputs.tasks]
    problems = {k: _problem(work, inputs, k) for k in inputs.tasks}
    share = work.application.objective.over_tasks.worst_share

    def ends(report: IterationReport) -> bool:
        return progress(report) or search_stopped()

    found = solve_shared(list(problems.values()), weights, inputs.start, options, ends, worst_share=share)
    stopped = found.status == STOPPED
    if stopped and not search_stopped():
        return Outcome(JobState.CANCELLED, summary=_how(found))
    better = _better_design(work, inputs, found, lambda *design: _total(work, problems, design, options, progress))
    design, gear_ratio = (inputs.start.design, inputs.gear_ratio) if better is None else (better, found.gear_ratio)
    at_optimum = better is not None and found.success
    decide = found.deciding if at_optimum else ()
    gears = gear_ratio if work.application.freedom.gears else None
    content = design_wire(design, motor, gears) | {
        "start": inputs.method,
        "stopped": stopped,
        **_how(found),
        "convergence": [list(point) for point in found.convergence[-MOST_CONVERGENCE_POINTS:]],
        "deciding_tasks": [
            {"index": k, "name": work.application.tasks[k].name, "share": share}
            for k, share in zip(inputs.tasks, decide, strict=bool(decide))
            if share > LEAST_SHARE
        ],
        "limits": limits_wire(found.design_limits if at_optimum else {}),
        "kkt_residual": finite(found.optimality.kkt_residual),
        "constraint_violation": finite(found.optimality.constraint_violation),
    }
    kept = f"not improved upon ({found.status}): the design of {inputs.method} stays" if better is None else None
    log = [(0, iteration, objective) for iteration, objective in found.convergence]
    designs = {SHARED: content} | snapped_designs(work.application, SHARED, design, gears)
    arrays = pack_points(dict(zip(inputs.tasks, found.motions, strict=True))) if at_optimum else None
    return Outcome(JobState.SUCCEEDED, kept, summary=_how(found), arrays=arrays, log=log, designs=designs)


def _problem(work: Work, inputs: SharedInputs, task: int) -> Problem:
    problem = work.application.build_problem(task, gear_ratio=inputs.gear_ratio)
    return with_references(problem, inputs.references[task]) if task in inputs.references else problem


def _better_design(
    work: Work, inputs: SharedInputs, found: SharedOptimum, total: Callable[[np.ndarray, np.ndarray | None], float]
) -> np.ndarray | None:
    """The design that the search came to, if it is better than the one it started from.

    `total` is what a design is judged by on the grid of the joint program. Motions that were refined to an accuracy
    lie on finer grids, where a minimum time is up to one percent shorter, so the start is judged once more. An iterate
    is no motion yet, and its design may break the motors' limits a little: it is made feasible, and judged as well.
    """
    to_beat = inputs.total if work.application.accuracy is None else total(inputs.start.design, inputs.gear_ratio)
    if not found.objective < to_beat:
        return None
    if found.success:
        return found.design
    projection = project_design(found.reached, work.application.build_motor())
    better = projection.feasible and total(projection.design, found.gear_ratio) < to_beat
    return projection.design if better else None


def _total(
    work: Work,
    problems: Mapping[int, Problem],
    design: tuple[np.ndarray, np.ndarray | None],
    options: SolverOptions,
    progress: Progress,
) -> float:
    """What a design with its gear ratios is judged by, every task solved with it; infinite when one cannot be."""
    lengths, gear_ratio = design
    solved = {}
    for k, problem in problems.items():
        robot = problem.robot if gear_ratio is None else problem.robot.with_gears(gear_ratio)
        solved[k] = solve(replace(problem, design=lengths, robot=robot), None, options, progress)
    return work.application.over_tasks({k: math.inf if s.objective is None else s.objective for k, s in solved.items()})


def _how(found: SharedOptimum) -> dict[str, object]:
    return {"solver_status": found.status, "iterations": found.iterations, "solve_time_s": found.solve_time}
