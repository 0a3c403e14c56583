"""The job that finds the best single design for all tasks, and never hands on one that is worse than it found."""

from __future__ import annotations

from dataclasses import replace

from services.codesign.problem import Problem
from services.codesign.shared_optimum import SharedOptimum, solve_shared
from services.codesign.solve import solve, with_references
from services.codesign.solver import STOPPED, Progress, SolverOptions
from services.jobs.certificates import finite
from services.jobs.design_wire import design_wire
from services.jobs.finish import Outcome
from services.jobs.limit_costs import limits_wire
from services.jobs.resolved import SHARED
from services.jobs.work import SharedInputs, Work
from shared.domain import JobState

MOST_CONVERGENCE_POINTS = 1000

LEAST_SHARE = 1e-3
"""A task that decides less than this about the worst one's objective does not decide: the barrier leaves a trace."""


def find_shared_optimum(work: Work, options: SolverOptions, progress: Progress) -> Outcome:
    """Solve Problem 1 from the best design known; where that is not improved upon, it stays."""
    inputs, motor = work.shared, work.application.build_motor()
    if inputs is None:
        return Outcome(JobState.FAILED, "there is no design to start from")
    weights = [work.application.tasks[k].weight for k in inputs.tasks]
    problems = [_problem(work, inputs, k) for k in inputs.tasks]
    share = work.application.objective.over_tasks.worst_share
    found = solve_shared(problems, weights, inputs.start, options, progress, worst_share=share)
    if found.status == STOPPED:
        return Outcome(JobState.CANCELLED, summary=_how(found))
    better = found.design is not None and found.objective < _total_to_beat(work, inputs, problems, options, progress)
    design = found.design if better and found.design is not None else inputs.start.design
    decide = found.deciding if better else ()
    content = design_wire(design, motor) | {
        "start": inputs.method,
        **_how(found),
        "convergence": [list(point) for point in found.convergence[-MOST_CONVERGENCE_POINTS:]],
        "deciding_tasks": [
            {"index": k, "name": work.application.tasks[k].name, "share": share}
            for k, share in zip(inputs.tasks, decide, strict=bool(decide))
            if share > LEAST_SHARE
        ],
        "limits": limits_wire(found.design_limits if better else {}),
        "kkt_residual": finite(found.optimality.kkt_residual),
        "constraint_violation": finite(found.optimality.constraint_violation),
    }
    kept = None if better else f"not improved upon ({found.status}): the design of {inputs.method} stays"
    log = [(0, iteration, objective) for iteration, objective in found.convergence]
    return Outcome(JobState.SUCCEEDED, kept, summary=_how(found), log=log, designs={SHARED: content})


def _problem(work: Work, inputs: SharedInputs, task: int) -> Problem:
    problem = work.application.build_problem(task)
    return with_references(problem, inputs.references[task]) if task in inputs.references else problem


def _total_to_beat(
    work: Work, inputs: SharedInputs, problems: list[Problem], options: SolverOptions, progress: Progress
) -> float:
    """What the best design known is judged by, on the grid of the shared program.

    Motions that were refined to an accuracy lie on finer grids, where a minimum time is up to one percent shorter, so
    they are solved once more.
    """
    if work.application.accuracy is None:
        return inputs.total
    solved = [solve(replace(problem, design=inputs.start.design), None, options, progress) for problem in problems]
    values = [float("inf") if s.objective is None else s.objective for s in solved]
    return work.application.over_tasks(dict(zip(inputs.tasks, values, strict=True)))


def _how(found: SharedOptimum) -> dict[str, object]:
    return {"solver_status": found.status, "iterations": found.iterations, "solve_time_s": found.solve_time}
