"""How long an application will still take, from the jobs that ended, and whether one waits for a compiler.

The first jobs on a machine compile derivatives, which takes longer than all their solves: a rate that includes them
says nothing. So only jobs count that began after the first one had ended.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from statistics import median
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from shared.db.clock import now
from shared.db.tables import Application, Event, Job
from shared.domain import JobState

ENOUGH = 3
"""Jobs that must have ended, of those that count, before there is an estimate."""
LATEST = 50
"""Jobs that it is taken from: the last ones, for stages differ."""
LATELY_S = 60.0
"""A worker that ended a job within this time is still at hand: between two stages most have nothing to do."""
COMPILING = "compiling"
"""Kind of the event that says that a job waits for a compiler (`services.jobs.claim.report_compiling`)."""


def time_left(session: Session, application: Application, jobs: int) -> float | None:
    """Time for so many more jobs [s]: a usual job's time, in as many rounds as the workers at hand need.

    The median is the usual: one job that had to compile after all does not move it. None while too few jobs have
    ended, and while nobody works.
    """
    of_application = (Job.application_id == application.id, Job.generation == application.generation)
    first_end = select(func.min(Job.finished_at)).where(*of_application).scalar_subquery()
    ended: Sequence[Any] = session.execute(
        select(Job.finished_at - Job.started_at, Job.worker, now() - Job.finished_at)
        .where(*of_application, Job.started_at >= first_end)
        .where(Job.state.in_([JobState.SUCCEEDED, JobState.FAILED]))
        .order_by(Job.finished_at.desc())
        .limit(LATEST)
    ).all()
    if len(ended) < ENOUGH:
        return None
    usual = median(seconds for seconds, _, _ in ended)
    lately = {worker for _, worker, ago in ended if ago < max(usual, LATELY_S)}
    running = session.scalars(select(Job.worker).where(*of_application, Job.state == JobState.RUNNING)).all()
    workers = len(lately.union(running))
    return ceil(jobs / workers) * usual if workers else None


def compiling(session: Session, application: Application) -> bool:
    """Whether the latest that was heard of a running job is that it compiles."""
    told = session.execute(
        select(Event.number, Event.content)
        .where(Event.application_id == application.id, Event.kind == COMPILING)
        .order_by(Event.number)
    )
    latest = {content["job_id"]: number for number, content in told}
    return any(_still(session, application, job_id, number) for job_id, number in latest.items())


def _still(session: Session, application: Application, job_id: str, number: int) -> bool:
    job = session.get(Job, job_id)
    if job is None or job.state != JobState.RUNNING:
        return False
    later = select(Event.number).where(
        Event.application_id == application.id, Event.number > number, Event.content["job_id"].as_string() == job_id
    )
    return session.scalars(later.limit(1)).first() is None
