"""How long an application will still take, from the jobs that ended, and whether one waits for a compiler.

The first jobs on a machine compile derivatives, which takes longer than all their solves: a rate that includes them
says nothing. So only jobs count that began after the first one had ended.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from statistics import median
from typing import Any

from sqlalchemy import Integer, String, bindparam, func, select
from sqlalchemy.orm import Session

from shared.db.clock import now
from shared.db.tables import Application, Event, Job, table_of
from shared.domain import JobState

ENOUGH = 3
"""Jobs that must have ended, of those that count, before there is an estimate."""
LATEST = 50
"""Jobs that it is taken from: the last ones, for stages differ."""
LATELY_S = 60.0
"""A worker that ended a job within this time is still at hand: between two stages most have nothing to do."""
COMPILING = "compiling"
"""Kind of the event that says that a job waits for a compiler (`services.jobs.claim.report_compiling`)."""


JOBS, EVENTS = table_of(Job), table_of(Event)
_APPLICATION, _GENERATION = bindparam("application", type_=String), bindparam("generation", type_=Integer)
_OF_APPLICATION = (JOBS.c.application_id == _APPLICATION, JOBS.c.generation == _GENERATION)

# Asked once a second by everyone who waits; so these are not put together anew each time.
_FIRST_END = select(func.min(JOBS.c.finished_at)).where(*_OF_APPLICATION).scalar_subquery()
_ENDED = (
    select(JOBS.c.finished_at - JOBS.c.started_at, JOBS.c.worker, now() - JOBS.c.finished_at)
    .where(*_OF_APPLICATION, JOBS.c.started_at >= _FIRST_END)
    .where(JOBS.c.state.in_([JobState.SUCCEEDED, JobState.FAILED]))
    .order_by(JOBS.c.finished_at.desc())
    .limit(LATEST)
)
_RUNNING = select(JOBS.c.worker).where(*_OF_APPLICATION, JOBS.c.state == JobState.RUNNING)
_TOLD = (
    select(EVENTS.c.number, EVENTS.c.content)
    .where(EVENTS.c.application_id == _APPLICATION, EVENTS.c.kind == COMPILING)
    .order_by(EVENTS.c.number)
)


def time_left(session: Session, application: Application, jobs: int) -> float | None:
    """Time for so many more jobs [s]: a usual job's time, in as many rounds as the workers at hand need.

    The median is the usual: one job that had to compile after all does not move it. None while too few jobs have
    ended, and while nobody works.
    """
    of = {"application": application.id, "generation": application.generation}
    ended: Sequence[Any] = session.execute(_ENDED, of).all()
    if len(ended) < ENOUGH:
        return None
    usual = median(seconds for seconds, _, _ in ended)
    lately = {worker for _, worker, ago in ended if ago < max(usual, LATELY_S)}
    workers = len(lately.union(session.scalars(_RUNNING, of)))
    return ceil(jobs / workers) * usual if workers else None


def compiling(session: Session, application: Application) -> bool:
    """Whether the latest that was heard of a running job is that it compiles."""
    told = session.execute(_TOLD, {"application": application.id})
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
