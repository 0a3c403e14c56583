"""Writes that several use cases share. Every one runs inside the caller's transaction.

Whoever changes an application or its jobs first locks the application's row (`lock_application`), so that two
transactions never wait for each other in a circle. SQLite has one writer at a time anyway.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import select, update
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session, defer

from services.jobs.open_stage import open_stage
from services.jobs.plan import Done, JobSpec, NextStage, Progress, plan_next
from services.jobs.record import job_event, prune, refuse_unknown
from services.jobs.resolved import ResolvedApplication
from shared.contracts.errors import printable
from shared.db.clock import now
from shared.db.tables import Application, Design, Event, Job, JobTransition, Outbox, Result, Stage
from shared.domain import ApplicationState, JobState
from shared.domain import Stage as StageName

MOTION_STAGES = (StageName.MOTIONS, StageName.SHARED_MOTIONS)
"""Stages whose jobs solve a task with a design given."""

LONGEST_REASON = 1000
"""Characters kept of an exception that ended a job or an application; the log has all of it."""

CANCELLED = "cancelled by request"
"""Reason of a cancelled job."""


def lock_application(session: Session, application_id: str) -> Application | None:
    """The application's row, locked until the transaction ends; its documents are read when they are asked for."""
    statement = (
        select(Application)
        .where(Application.id == application_id)
        .options(defer(Application.request), defer(Application.resolved), defer(Application.versions))
        .with_for_update()
    )
    return session.scalars(statement.execution_options(populate_existing=True)).one_or_none()


def emit(session: Session, application: Application, kind: str, content: dict[str, Any]) -> None:
    """Append to the application's events; the caller holds its lock."""
    application.last_event += 1
    session.add(Event(application_id=application.id, number=application.last_event, kind=kind, content=content))
    prune(session.connection(), application.id, application.last_event)


def record_transition(
    session: Session, application: Application, job: Job, to: JobState, worker: str | None = None
) -> None:
    """Append to the history and the events; refuse a transition that does not exist."""
    source = JobState(job.state)
    refuse_unknown(job.id, source, to)
    session.add(
        JobTransition(
            job_id=job.id,
            application_id=job.application_id,
            from_state=source,
            to_state=to,
            token=job.token,
            worker=worker if worker is not None else job.worker,
        )
    )
    spec = JobSpec(StageName(job.stage), job.method, job.task_index)
    emit(session, application, "job", job_event(job.id, spec, source, to))


def settle(
    session: Session, application: Application, jobs: Sequence[Job], to: JobState, reason: str | None = None
) -> None:
    """Move jobs of one application and stage into a final state, and go on when the stage is empty.

    The caller holds the application's lock and has made sure that each job is still open.
    """
    assert to.final
    if not jobs:
        return
    for job in jobs:
        record_transition(session, application, job, to)
        job.state, job.reason, job.lease_until = to, reason, None
        job.finished_at = now()
    session.flush()
    silence(session, [job.id for job in jobs])
    stage = StageName(jobs[0].stage)
    remaining = session.scalar(
        update(Stage)
        .where(Stage.application_id == application.id, Stage.generation == application.generation, Stage.name == stage)
        .values(remaining=Stage.remaining - len(jobs))
        .returning(Stage.remaining)
        .execution_options(synchronize_session=False)
    )
    if remaining == 0:
        _advance(session, application, stage)


def requeue(session: Session, application: Application, job: Job, by: str | None = None) -> None:
    """Put a running job back into the queue, with a message; `by`: who does it, if not the job's worker."""
    record_transition(session, application, job, JobState.QUEUED, by)
    job.state, job.lease_until = JobState.QUEUED, None
    session.flush()
    session.execute(update(Outbox).where(Outbox.job_id == job.id).values(due_at=now(), sent=0))


def silence(session: Session, job_ids: Sequence[str]) -> None:
    """These jobs need no message any more."""
    session.execute(
        update(Outbox)
        .where(Outbox.job_id.in_(job_ids))
        .values(due_at=None)
        .execution_options(synchronize_session=False)
    )


def advance(session: Session, application_id: str, finished: StageName) -> None:
    """Go on with an application whose stage is empty; the caller's transaction has its lock."""
    application = lock_application(session, application_id)
    assert application is not None
    _advance(session, application, finished)
    session.flush()


def _advance(session: Session, application: Application, finished: StageName) -> None:
    if application.cancel_requested:
        _finish(session, application, Done(ApplicationState.CANCELLED))
        return
    following = _plan(session, application, finished)
    if isinstance(following, NextStage):
        open_stage(session, application, following)
    else:
        _finish(session, application, following)


def _plan(session: Session, application: Application, finished: StageName) -> NextStage | Done:
    """What comes next. An exception in planning ends the application, with the reason, or it would stay open."""
    try:
        resolved = ResolvedApplication.model_validate(application.resolved)
        return plan_next(resolved, progress_of(session, application, resolved, finished))
    except SQLAlchemyError:
        raise
    except Exception as error:
        reason = printable(f"what follows {finished} cannot be planned: {type(error).__name__}: {error}")
        return Done(ApplicationState.FAILED, reason[:LONGEST_REASON])


def _finish(session: Session, application: Application, done: Done) -> None:
    application.state, application.reason = done.state, done.reason
    application.finished_at = now()
    emit(session, application, "application", {"state": done.state, "reason": done.reason})


def progress_of(
    session: Session, application: Application, resolved: ResolvedApplication, finished: StageName
) -> Progress:
    """What the planner needs to know, read from the rows of the current generation."""
    of_application = (Job.application_id == application.id, Job.generation == application.generation)
    rows = session.execute(select(Job.stage, Job.method, Job.task_index, Job.state).where(*of_application)).all()
    succeeded = [row for row in rows if row.state == JobState.SUCCEEDED]
    kinds = session.scalars(
        select(Design.kind).where(Design.application_id == application.id, Design.generation == application.generation)
    )
    return Progress(
        finished=finished,
        solved_tasks=tuple(sorted(row.task_index for row in succeeded if row.stage == StageName.CODESIGN)),
        designs=frozenset(kinds),
        motions=sum(row.stage in MOTION_STAGES and row.method == resolved.method for row in succeeded),
        failures=sum(row.state in (JobState.FAILED, JobState.DEAD) for row in rows),
    )


def results_of(session: Session, application: Application, *stages: StageName) -> list[Result]:
    """Results of some stages in the current generation, by task, without their arrays."""
    statement = (
        select(Result)
        .where(
            Result.application_id == application.id,
            Result.generation == application.generation,
            Result.stage.in_(stages),
        )
        .order_by(Result.task_index)
        .options(defer(Result.arrays), defer(Result.log))
    )
    return list(session.scalars(statement))
