"""What comes after a stage: one pure function, without a database (DESIGN: data flow)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from services.jobs.resolved import SHARED, ResolvedApplication
from shared.domain import NO_METHOD, NO_TASK, ApplicationState, Stage


@dataclass(frozen=True)
class JobSpec:
    """One job, not yet in the database."""

    stage: Stage
    method: str = NO_METHOD
    task_index: int = NO_TASK


@dataclass(frozen=True)
class NextStage:
    """The application goes on."""

    stage: Stage
    jobs: tuple[JobSpec, ...]


@dataclass(frozen=True)
class Done:
    """The application is at its end."""

    state: ApplicationState
    reason: str | None = None


@dataclass(frozen=True)
class Progress:
    """What an application has when all jobs of a stage are final."""

    finished: Stage
    solved_tasks: tuple[int, ...]  # tasks whose own co-design succeeded
    designs: frozenset[str]  # methods that have a design
    motions: int  # solved motions of the application's own method
    failures: int  # jobs failed or dead so far


def plan_first(application: ResolvedApplication) -> NextStage:
    """One co-design job for each task: every method, and every regret, starts from the tasks' own optima."""
    return NextStage(
        Stage.CODESIGN, tuple(JobSpec(Stage.CODESIGN, task_index=k) for k in range(len(application.tasks)))
    )


def plan_next(application: ResolvedApplication, progress: Progress) -> NextStage | Done:
    """Jobs of the stage after `progress.finished`, or the application's final state."""
    after = {
        Stage.CODESIGN: _after_codesign,
        Stage.RECONCILE: _after_reconcile,
        Stage.MOTIONS: _after_motions,
        Stage.SHARED_OPTIMUM: _after_shared_optimum,
        Stage.SHARED_MOTIONS: _end,
    }
    return after[progress.finished](application, progress)


def _after_codesign(_application: ResolvedApplication, progress: Progress) -> NextStage | Done:
    if not progress.solved_tasks:
        return Done(ApplicationState.FAILED, "no task could be solved; each task says why")
    return NextStage(Stage.RECONCILE, (JobSpec(Stage.RECONCILE),))


def _after_reconcile(application: ResolvedApplication, progress: Progress) -> NextStage | Done:
    """Motions of the tasks that can be solved at all; a task without a co-design is left out, and said to be."""
    if application.method not in progress.designs and application.method not in application.late_methods:
        return Done(ApplicationState.FAILED, f"method {application.method} gave no design")
    methods = [method for method in application.base_methods if method in progress.designs]
    jobs = (JobSpec(Stage.MOTIONS, method, task) for method in methods for task in progress.solved_tasks)
    return NextStage(Stage.MOTIONS, tuple(jobs))


def _after_motions(application: ResolvedApplication, progress: Progress) -> NextStage | Done:
    """The shared optimum starts from the best of the other methods."""
    if SHARED in application.methods:
        return NextStage(Stage.SHARED_OPTIMUM, (JobSpec(Stage.SHARED_OPTIMUM, SHARED),))
    return _end(application, progress)


def _after_shared_optimum(application: ResolvedApplication, progress: Progress) -> NextStage | Done:
    if SHARED not in progress.designs:
        return _end(application, progress)
    methods = [method for method in application.late_methods if method in progress.designs]
    jobs = (JobSpec(Stage.SHARED_MOTIONS, method, task) for method in methods for task in progress.solved_tasks)
    return NextStage(Stage.SHARED_MOTIONS, tuple(jobs))


def _end(application: ResolvedApplication, progress: Progress) -> Done:
    if not progress.motions:
        return Done(ApplicationState.FAILED, f"no task could be solved with the design of method {application.method}")
    missing = [method for method in application.methods if method not in progress.designs]
    if progress.failures or missing:
        return Done(ApplicationState.COMPLETED_WITH_FAILURES, _what_is_missing(progress.failures, missing))
    return Done(ApplicationState.SUCCEEDED)


def planned_jobs(application: ResolvedApplication) -> dict[Stage, int]:
    """How many jobs each stage has when nothing fails, for progress displays."""
    n = len(application.tasks)
    stages = {Stage.CODESIGN: n, Stage.RECONCILE: 1, Stage.MOTIONS: n * len(application.base_methods)}
    if SHARED in application.methods:
        stages |= {Stage.SHARED_OPTIMUM: 1, Stage.SHARED_MOTIONS: n * len(application.late_methods)}
    return stages


def _what_is_missing(failures: int, methods: Sequence[str]) -> str:
    parts = [f"{failures} solve{'s' if failures != 1 else ''} failed"] if failures else []
    parts += [f"method {method} has no design" for method in methods]
    return "; ".join(parts)
