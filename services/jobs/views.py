"""What is stored, as people get it. Everything is read; nothing is computed that a job could have stored."""

from __future__ import annotations

from collections import Counter, defaultdict
from datetime import UTC, datetime
from typing import Any, Literal

from sqlalchemy import Engine, Integer, String, bindparam, func, select
from sqlalchemy.orm import Session, defer

from services.jobs.plan import planned_jobs
from services.jobs.resolved import SHARED, ResolvedApplication
from services.jobs.spec import spec_of
from services.jobs.stop_search import searches
from services.jobs.time_left import compiling, time_left
from shared.contracts.motions import MotionResult, TaskList, TaskResult
from shared.contracts.states import ApplicationStatus, ExcludedTask, LatestResult, Progress, StageProgress, Timings
from shared.db.engine import reading
from shared.db.tables import Application, Job, Result, table_of
from shared.domain import ApplicationState, JobState, Stage

UNITS = {"time": "s", "energy": "V2 s", "weighted": "1", "electrical_energy": "J"}
"""Of the objectives."""


class NotFoundError(Exception):
    """There is no such application, task, or result; the message says which."""


_WITHOUT_DOCUMENTS = [defer(Application.request), defer(Application.resolved)]


def load(session: Session, application_id: str) -> tuple[Application, ResolvedApplication]:
    """An application's row and meaning.

    Raises
    ------
    NotFoundError
    """
    application = session.get(Application, application_id, options=_WITHOUT_DOCUMENTS)
    resolved = None if application is None else spec_of(session, application_id)
    if application is None or resolved is None:
        raise NotFoundError(f"there is no application {application_id}")
    return application, resolved


def state_of(engine: Engine, application_id: str) -> ApplicationState:
    """Where an application stands, and no more.

    Raises
    ------
    NotFoundError
    """
    with reading(engine) as session:
        state = session.scalar(select(Application.state).where(Application.id == application_id))
    if state is None:
        raise NotFoundError(f"there is no application {application_id}")
    return ApplicationState(state)


def status(engine: Engine, application_id: str) -> ApplicationStatus:
    """An application as it stands."""
    with reading(engine) as session:
        application, resolved = load(session, application_id)
        return ApplicationStatus(
            id=application.id,
            name=application.name,
            state=application.state,
            reason=application.reason,
            cancel_requested=application.cancel_requested,
            search=_search(session, application, resolved),
            progress=_progress(session, application, resolved),
            objective=resolved.objective,
            method=resolved.method,
            methods=resolved.methods,
            robot=str(resolved.robot.get("name")),
            tasks=len(resolved.tasks),
            grid=resolved.grid,
            excluded_tasks=_excluded(session, application, resolved),
            timings=_timings(session, application),
            created_at=iso_time(application.created_at) or "",
            started_at=iso_time(application.started_at),
            finished_at=iso_time(application.finished_at),
            tags=application.tags,
            versions=application.versions,
        )


def tasks(engine: Engine, application_id: str, start: int, limit: int) -> TaskList:
    """Tasks `start`, `start` + 1, ... with their results so far."""
    with reading(engine) as session:
        application, resolved = load(session, application_id)
        start, stop = (min(end, len(resolved.tasks)) for end in (start, start + limit))
        items = _tasks(session, application, resolved, range(start, stop))
    return TaskList(items=items, next_cursor=str(stop) if stop < len(resolved.tasks) else None)


def task(engine: Engine, application_id: str, index: int) -> TaskResult:
    """One task."""
    with reading(engine) as session:
        application, resolved = load(session, application_id)
        require_task(resolved, index)
        return _tasks(session, application, resolved, range(index, index + 1))[0]


def require_task(resolved: ResolvedApplication, index: int) -> None:
    """Check that an application has a task.

    Raises
    ------
    NotFoundError
    """
    if not 0 <= index < len(resolved.tasks):
        raise NotFoundError(f"the application has tasks 0 to {len(resolved.tasks) - 1}, there is no task {index}")


def _tasks(
    session: Session, application: Application, resolved: ResolvedApplication, indices: range
) -> list[TaskResult]:
    of_range = (
        Job.application_id == application.id,
        Job.generation == application.generation,
        Job.task_index >= indices.start,
        Job.task_index < indices.stop,
    )
    jobs = session.execute(select(Job.stage, Job.method, Job.task_index, Job.state, Job.reason).where(*of_range)).all()
    stored = session.execute(
        select(Result.stage, Result.method, Result.task_index, Result.summary).where(
            Result.application_id == application.id,
            Result.generation == application.generation,
            Result.task_index >= indices.start,
            Result.task_index < indices.stop,
        )
    ).all()
    by_task = defaultdict(list)
    for job in jobs:
        by_task[job.task_index].append(job)
    summaries = {(row.task_index, row.stage, row.method): row.summary for row in stored}
    return [_task(resolved, k, by_task[k], summaries) for k in indices]


def _task(
    resolved: ResolvedApplication, index: int, jobs: list[Any], summaries: dict[tuple[int, str, str], dict[str, Any]]
) -> TaskResult:
    asked = resolved.tasks[index]
    own = summaries.get((index, Stage.CODESIGN, ""), {})
    late = dict.fromkeys(resolved.late_methods, Stage.SHARED_MOTIONS)
    motions = {
        method: summaries.get((index, late.get(method, Stage.MOTIONS), method), {}) for method in resolved.methods
    }
    reasons = [job.reason for job in sorted(jobs, key=lambda job: str(job.stage)) if job.reason]
    return TaskResult(
        index=index,
        name=asked.name,
        payload_kg=asked.payload_kg,
        weight=asked.weight,
        state=_task_state([JobState(job.state) for job in jobs]),
        reason=reasons[0] if reasons else None,
        solver_status=own.get("solver_status"),
        iterations=own.get("iterations"),
        solve_time_s=own.get("solve_time_s"),
        own=motion_result(own),
        methods={method: result for method, s in motions.items() if (result := motion_result(s)) is not None},
    )


def motion_result(summary: dict[str, Any]) -> MotionResult | None:
    """A stored summary as people get it; None when its solve failed."""
    return MotionResult.model_validate(summary) if "final_time_s" in summary else None


def _task_state(states: list[JobState]) -> str:
    """The worst of a task's jobs."""
    for state in (JobState.DEAD, JobState.FAILED, JobState.CANCELLED, JobState.RUNNING, JobState.QUEUED):
        if state in states:
            return state
    return JobState.SUCCEEDED if states else JobState.QUEUED


JOBS, RESULTS = table_of(Job), table_of(Result)
_APPLICATION, _GENERATION = bindparam("application", type_=String), bindparam("generation", type_=Integer)
_JOBS_OF = (JOBS.c.application_id == _APPLICATION, JOBS.c.generation == _GENERATION)
_RESULTS_OF = (RESULTS.c.application_id == _APPLICATION, RESULTS.c.generation == _GENERATION)

# What is asked most often, once a second by everyone who waits; so these are not put together anew each time.
_COUNTS = select(JOBS.c.stage, JOBS.c.state, func.count()).where(*_JOBS_OF).group_by(JOBS.c.stage, JOBS.c.state)
_RESULT = (
    select(RESULTS.c.task_index, RESULTS.c.stage, RESULTS.c.method, RESULTS.c.value)
    .join(JOBS, JOBS.c.id == RESULTS.c.job_id)
    .where(*_RESULTS_OF, RESULTS.c.value.is_not(None))
    .limit(1)
)
_LATEST, _BEST = _RESULT.order_by(JOBS.c.finished_at.desc()), _RESULT.order_by(RESULTS.c.value)
_EXCLUDED = (
    select(JOBS.c.task_index, JOBS.c.reason)
    .where(*_JOBS_OF, JOBS.c.stage == Stage.CODESIGN, JOBS.c.state.in_([JobState.FAILED, JobState.DEAD]))
    .order_by(JOBS.c.task_index)
)
_SPAN = select(
    func.min(JOBS.c.started_at), func.max(JOBS.c.finished_at), func.sum(JOBS.c.finished_at - JOBS.c.started_at)
).where(*_JOBS_OF)
_SOLVE_TIME = select(func.sum(RESULTS.c.summary["solve_time_s"].as_float())).where(*_RESULTS_OF)


def _of(application: Application) -> dict[str, Any]:
    """Parameters of the statements above."""
    return {"application": application.id, "generation": application.generation}


def _progress(session: Session, application: Application, resolved: ResolvedApplication) -> Progress:
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    rows = session.execute(_COUNTS, _of(application))
    for stage, state, count in rows:
        counts[stage][state] = count
    planned = planned_jobs(resolved)
    stages = [
        StageProgress(name=stage, total=sum(counts[stage].values()) or total, **counts[stage])
        for stage, total in planned.items()
    ]
    finished = application.finished_at is not None
    done = sum(s.succeeded + s.failed + s.dead + s.cancelled for s in stages)
    total = sum(s.queued + s.running for s in stages) + done if finished else sum(s.total for s in stages)
    return Progress(
        stages=stages,
        done=done,
        total=total,
        eta_s=None if finished else time_left(session, application, total - done),
        compiling=not finished and compiling(session, application),
        last=_result(session, application, resolved, latest=True),
        best=_result(session, application, resolved, latest=False),
    )


def _search(
    session: Session, application: Application, resolved: ResolvedApplication
) -> Literal["running", "stopping"] | None:
    if SHARED not in resolved.methods or application.finished_at is not None:
        return None
    job = session.scalars(searches(application)).one_or_none()
    if job is None:
        return None
    return "stopping" if job.stop_requested else "running"


def _result(
    session: Session, application: Application, resolved: ResolvedApplication, *, latest: bool
) -> LatestResult | None:
    row = session.execute(_LATEST if latest else _BEST, _of(application)).one_or_none()
    if row is None:
        return None
    return LatestResult(
        task=resolved.tasks[row.task_index].name,
        task_index=row.task_index,
        stage=row.stage,
        method=row.method or "own",
        value=row.value,
        unit=objective_unit(resolved),
    )


def objective_unit(resolved: ResolvedApplication) -> str:
    """Unit of the objective; a weighted one is a plain number."""
    return UNITS[resolved.objective.kind]


def _excluded(session: Session, application: Application, resolved: ResolvedApplication) -> list[ExcludedTask]:
    rows = session.execute(_EXCLUDED, _of(application))
    return [
        ExcludedTask(index=row.task_index, name=resolved.tasks[row.task_index].name, reason=row.reason) for row in rows
    ]


def _timings(session: Session, application: Application) -> Timings:
    first, last, worked = session.execute(_SPAN, _of(application)).one()
    solved = session.scalar(_SOLVE_TIME, _of(application))
    wall = None if first is None or last is None else last - first
    return Timings(solver_time_s=solved or 0.0, worker_time_s=worked or 0.0, wall_time_s=wall)


def iso_time(seconds: float | None) -> str | None:
    """On the wire: ISO 8601 in UTC, to the millisecond."""
    return None if seconds is None else datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds")
