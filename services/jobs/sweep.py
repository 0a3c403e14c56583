"""Recover jobs whose worker fell silent."""

from __future__ import annotations

import structlog
from sqlalchemy import Engine, select
from sqlalchemy.exc import DBAPIError

from services.jobs.store import CANCELLED, lock_application, requeue, settle
from services.jobs.tally import SWEEP
from shared.db.clock import now
from shared.db.engine import reading, transaction
from shared.db.tables import Job
from shared.domain import JobState

log = structlog.get_logger()

BATCH = 200
"""Expired leases looked at in one sweep."""


def sweep(engine: Engine, max_attempts: int) -> int:
    """Put jobs with an expired lease back into the queue, or bury them; returns how many."""
    with reading(engine) as session:
        expired = session.execute(
            select(Job.id, Job.application_id)
            .where(Job.state == JobState.RUNNING, Job.lease_until < now())
            .limit(BATCH)
        ).all()
    return sum(_try_to_recover(engine, row.id, row.application_id, max_attempts) for row in expired)


def _try_to_recover(engine: Engine, job_id: str, application_id: str, max_attempts: int) -> bool:
    """One job that cannot be recovered must not hold up the others."""
    try:
        return _recover(engine, job_id, application_id, max_attempts)
    except DBAPIError:
        raise  # the database is away for all of them
    except Exception:
        log.exception("job not recovered", job=job_id, application=application_id)
        return False


def _recover(engine: Engine, job_id: str, application_id: str, max_attempts: int) -> bool:
    with transaction(engine) as session:
        application = lock_application(session, application_id)
        still_expired = select(Job).where(Job.id == job_id, Job.state == JobState.RUNNING, Job.lease_until < now())
        job = session.scalars(still_expired.execution_options(populate_existing=True)).one_or_none()
        if application is None or job is None:
            return False
        if application.cancel_requested:
            settle(session, application, [job], JobState.CANCELLED, CANCELLED)
        elif job.attempts >= max_attempts:
            reason = f"its worker was lost {job.attempts} times"
            settle(session, application, [job], JobState.DEAD, reason)
        else:
            requeue(session, application, job, by=SWEEP)
    log.warning(
        "lease expired",
        job=job_id,
        application=application_id,
        worker=job.worker,
        attempt=job.attempts,
        state=job.state,
    )
    return True
