"""Leases: claim a job, keep it, give it back.

A claim is a conditional UPDATE; its token fences off anyone whose lease was lost in the meantime.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

from sqlalchemy import Engine, select, update

from services.codesign.solver import IterationReport
from services.jobs.plan import JobSpec
from services.jobs.store import CANCELLED, emit, lock_application, record_transition, requeue, settle, silence
from shared.db.clock import now
from shared.db.engine import reading, transaction
from shared.db.tables import Application, Job
from shared.domain import ApplicationState, JobState, Stage


@dataclass(frozen=True)
class Claim:
    """A lease on a job."""

    job_id: str
    application_id: str
    generation: int
    spec: JobSpec
    token: int
    worker: str


def claim(engine: Engine, job_id: str, worker: str, lease_s: float) -> Claim | None:
    """Take a queued job; None when it is not queued (a doubled or late message) or gone."""
    with transaction(engine) as session:
        application_id = session.scalar(
            select(Job.application_id).where(Job.id == job_id, Job.state == JobState.QUEUED)
        )
        if application_id is None:
            return None
        application = lock_application(session, application_id)
        job = session.get(Job, job_id, populate_existing=True)
        if application is None or job is None or job.state != JobState.QUEUED:
            return None
        job.token, job.attempts = job.token + 1, job.attempts + 1
        record_transition(session, application, job, JobState.RUNNING, worker)
        job.state, job.worker, job.lease_until = JobState.RUNNING, worker, now() + lease_s
        if job.started_at is None:
            job.started_at = now()
        if application.state == ApplicationState.QUEUED:
            application.state = ApplicationState.RUNNING
            if application.started_at is None:
                application.started_at = now()
            emit(session, application, "application", {"state": ApplicationState.RUNNING, "reason": None})
        session.flush()
        silence(session, [job_id])
        spec = JobSpec(Stage(job.stage), job.method, job.task_index)
        return Claim(job_id, application_id, job.generation, spec, job.token, worker)


@dataclass(frozen=True)
class Requests:
    """What people ask of a running job."""

    cancelled: bool  # also when its application was deleted
    search_stopped: bool  # to end with the best that it has


@dataclass(frozen=True)
class Pulse(Requests):
    """What a worker learns when it renews its lease."""

    mine: bool


def renew(engine: Engine, held: Claim, lease_s: float) -> Pulse:
    """Extend the lease; `mine` is False when it was lost."""
    with transaction(engine) as session:
        renewed = session.execute(
            update(Job)
            .where(Job.id == held.job_id, Job.token == held.token, Job.state == JobState.RUNNING)
            .values(lease_until=now() + lease_s)
            .returning(Job.id)
        ).first()
    return Pulse(**asdict(requests_of(engine, held)), mine=renewed is not None)


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
    with transaction(engine) as session:
        application = lock_application(session, held.application_id)
        job = session.get(Job, held.job_id)
        if application is None or job is None or job.token != held.token or job.state != JobState.RUNNING:
            return
        place = {"stage": job.stage, "method": job.method, "task_index": job.task_index}
        emit(session, application, "iteration", {"job_id": job.id, **place, **asdict(iteration)})


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
