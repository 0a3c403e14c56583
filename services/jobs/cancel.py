"""Cancel an application: queued jobs at once, running ones as soon as their workers see the flag. Or delete it."""

from __future__ import annotations

from itertools import groupby

from sqlalchemy import Engine, delete, select

from services.jobs.store import CANCELLED, emit, lock_application, settle
from shared.db.engine import transaction
from shared.db.tables import Application, Job
from shared.domain import ApplicationState, JobState


def cancel(engine: Engine, application_id: str) -> bool:
    """Ask for an end; False when there is no such application. Cancelling a final one changes nothing."""
    with transaction(engine) as session:
        application = lock_application(session, application_id)
        if application is None:
            return False
        if ApplicationState(application.state).final:
            return True
        if not application.cancel_requested:
            application.cancel_requested = True
            emit(session, application, "cancel", {})
        queued = session.scalars(
            select(Job)
            .where(Job.application_id == application_id, Job.state == JobState.QUEUED)
            .order_by(Job.stage)
            .with_for_update()
        ).all()
        for _, jobs in groupby(queued, key=lambda job: job.stage):
            settle(session, application, list(jobs), JobState.CANCELLED, CANCELLED)
        return True


def delete_application(engine: Engine, application_id: str) -> bool:
    """Remove an application with all it owns; its running jobs find their lease gone. False when there is none."""
    with transaction(engine) as session:
        if lock_application(session, application_id) is None:
            return False
        session.execute(delete(Application).where(Application.id == application_id))
        return True
