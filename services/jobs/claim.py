"""Leases: claim a job, keep it, give it back.

A claim is a conditional UPDATE; its token fences off anyone whose lease was lost in the meantime.
"""

from __future__ import annotations

import random
from dataclasses import asdict, dataclass
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Engine,
    Float,
    Integer,
    String,
    bindparam,
    case,
    func,
    literal,
    null,
    select,
    update,
)

from services.codesign.solver import IterationReport
from services.jobs.plan import JobSpec
from services.jobs.record import APPLICATIONS, HELD_TOKEN, JOBS, OF_APPLICATION, OF_JOB, PLACE, STATE, prune, record
from services.jobs.store import CANCELLED, emit, lock_application, requeue, settle
from services.jobs.time_left import COMPILING
from shared.db.clock import now
from shared.db.documents import json_object
from shared.db.engine import at_once, reading, transaction
from shared.db.tables import Application, Event, Job, Outbox, table_of
from shared.db.together import Columns, Statement, WithRow, row_into
from shared.domain import ApplicationState, JobState, Stage

_OUTBOX = table_of(Outbox)


@dataclass(frozen=True)
class Claim:
    """A lease on a job."""

    job_id: str
    application_id: str
    generation: int
    spec: JobSpec
    token: int
    worker: str


def _take(job: Columns) -> dict[str, Statement]:
    """What a claim writes."""
    by = bindparam("by", type_=String)
    first = job["application_state"] == literal(ApplicationState.QUEUED, String)
    begun = {
        "application_id": job["application_id"],
        "number": job["last_event"] + 2,
        "kind": literal("application", String),
        "content": json_object({"state": literal(ApplicationState.RUNNING, String), "reason": null()}),
        "at": now(),
    }
    return {
        "job": update(JOBS)
        .where(JOBS.c.id == job["job_id"])
        .values(
            state=JobState.RUNNING,
            token=JOBS.c.token + 1,
            attempts=JOBS.c.attempts + 1,
            worker=by,
            lease_until=now() + bindparam("lease_s", type_=Float),
            started_at=func.coalesce(JOBS.c.started_at, now()),
        ),
        "application": update(APPLICATIONS)
        .where(APPLICATIONS.c.id == job["application_id"])
        .values(
            last_event=job["last_event"] + case((first, 2), else_=1),
            state=ApplicationState.RUNNING,
            started_at=func.coalesce(APPLICATIONS.c.started_at, now()),
        ),
        "message": update(_OUTBOX).where(_OUTBOX.c.job_id == job["job_id"]).values(due_at=None),
        "begun": row_into(Event, begun, first),
        **record(
            job,
            job["token"] + 1,
            literal(JobState.QUEUED, String),
            literal(JobState.RUNNING, String),
            by,
        ),
    }


def _claim_of(job_id: ColumnElement[str]) -> WithRow:
    """The claim of one job, if it is queued."""
    found = (
        select(
            JOBS.c.id.label("job_id"),
            *PLACE,
            JOBS.c.token,
            APPLICATIONS.c.state.label("application_state"),
            APPLICATIONS.c.last_event,
        )
        .join_from(APPLICATIONS, JOBS, JOBS.c.application_id == APPLICATIONS.c.id)
        .where(JOBS.c.id == job_id, STATE == JobState.QUEUED)
        .with_for_update(of=[APPLICATIONS, JOBS])
    )
    return WithRow(found, _take)


_NEXT_DUE = (
    select(_OUTBOX.c.job_id, _OUTBOX.c.sent)
    .where(_OUTBOX.c.due_at > 0)  # not null, said so that SQLite too finds them by index
    .order_by(_OUTBOX.c.due_at)
    .limit(1)
    .offset(bindparam("older", type_=Integer))
    .subquery()
)
"""Those that were sent come last, since they are due again later; the index alone tells which is next."""
_UNSENT = select(_NEXT_DUE.c.job_id).where(_NEXT_DUE.c.sent == 0)

_CLAIM, _CLAIM_UNSENT = _claim_of(OF_JOB), _claim_of(_UNSENT.scalar_subquery())

SPREAD = 8
"""A process at hand takes one of so many jobs that have waited longest: two of them rarely want the same."""


def claim(engine: Engine, job_id: str, worker: str, lease_s: float) -> Claim | None:
    """Take a queued job; None when it is not queued (a doubled or late message) or gone."""
    return _claim(engine, _CLAIM, {"of_job": job_id, "by": worker, "lease_s": lease_s})


def claim_unsent(engine: Engine, worker: str, lease_s: float) -> Claim | None:
    """Take a job whose message has not been sent, and is then needed no more; None when it finds none.

    None does not mean that there is none. Somebody may have taken the same at this moment, or fewer may wait than it
    has passed over; their messages will be sent.
    """
    older = random.randrange(SPREAD)
    return _claim(engine, _CLAIM_UNSENT, {"older": older, "by": worker, "lease_s": lease_s})


def _claim(engine: Engine, statement: WithRow, values: dict[str, Any]) -> Claim | None:
    with at_once(engine) as connection:
        job = statement.run(connection, values)
        if job is None:
            return None
        prune(connection, job["application_id"], job["last_event"] + 1)
    spec = JobSpec(Stage(job["stage"]), job["method"], job["task_index"])
    return Claim(job["job_id"], job["application_id"], job["generation"], spec, job["token"] + 1, values["by"])


@dataclass(frozen=True)
class Requests:
    """What people ask of a running job."""

    cancelled: bool  # also when its application was deleted
    search_stopped: bool  # to end with the best that it has


@dataclass(frozen=True)
class Pulse(Requests):
    """What a worker learns when it renews its lease."""

    mine: bool


_RENEW = (
    update(JOBS)
    .where(JOBS.c.id == OF_JOB, JOBS.c.token == HELD_TOKEN, STATE == JobState.RUNNING)
    .values(lease_until=now() + bindparam("lease_s", type_=Float))
    .returning(
        select(APPLICATIONS.c.cancel_requested)
        .where(APPLICATIONS.c.id == OF_APPLICATION)
        .scalar_subquery()
        .label("cancelled"),
        JOBS.c.stop_requested.label("search_stopped"),
    )
)


def renew(engine: Engine, held: Claim, lease_s: float) -> Pulse:
    """Extend the lease; `mine` is False when it was lost."""
    values = {"of_job": held.job_id, "of_application": held.application_id, "held_token": held.token}
    with at_once(engine) as connection:
        renewed = connection.execute(_RENEW, values | {"lease_s": lease_s}).one_or_none()
    if renewed is None:
        return Pulse(**asdict(requests_of(engine, held)), mine=False)
    return Pulse(**renewed._asdict(), mine=True)


def requests_of(engine: Engine, held: Claim) -> Requests:
    """What was asked of a claimed job."""
    statement = (
        select(Application.cancel_requested, Job.stop_requested)
        .join(Job, Job.application_id == Application.id)
        .where(Job.id == held.job_id)
    )
    with reading(engine) as session:
        flags = session.execute(statement).one_or_none()
    return Requests(True, False) if flags is None else Requests(*flags)


def report(engine: Engine, held: Claim, iteration: IterationReport) -> None:
    """Tell the application's events how far a solve is; nothing when the lease was lost."""
    _tell(engine, held, "iteration", asdict(iteration))


def report_compiling(engine: Engine, held: Claim) -> None:
    """Tell them that a job waits for derivatives to be compiled."""
    _tell(engine, held, COMPILING, {})


def _tell(engine: Engine, held: Claim, kind: str, content: dict[str, Any]) -> None:
    with transaction(engine) as session:
        application = lock_application(session, held.application_id)
        job = session.get(Job, held.job_id)
        if application is None or job is None or job.token != held.token or job.state != JobState.RUNNING:
            return
        place = {"stage": job.stage, "method": job.method, "task_index": job.task_index}
        emit(session, application, kind, {"job_id": job.id, **place, **content})


def release(engine: Engine, held: Claim) -> bool:
    """Give a job back unfinished, without counting the attempt; False when the lease was lost meanwhile."""
    with transaction(engine) as session:
        application = lock_application(session, held.application_id)
        job = session.get(Job, held.job_id, populate_existing=True)
        if application is None or job is None or job.token != held.token or job.state != JobState.RUNNING:
            return False
        job.attempts -= 1
        if application.cancel_requested:
            settle(session, application, [job], JobState.CANCELLED, CANCELLED)
        else:
            requeue(session, application, job)
        return True
