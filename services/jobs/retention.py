"""Delete what is finished and old, a little at a time."""

from __future__ import annotations

from sqlalchemy import Engine, delete, select

from services.jobs.store import lock_application
from shared.db.clock import now
from shared.db.engine import reading, transaction
from shared.db.tables import Application
from shared.domain import ApplicationState

BATCH = 20
"""Applications deleted in one go; each in a transaction of its own, so that nobody waits for long."""
DAY_S = 86_400.0


def forget_old(engine: Engine, days: float) -> int:
    """Delete applications that finished more than `days` ago (0: none) with all they own; returns how many.

    Their idempotency keys go with them: sent again after that, a submission is a new application.
    """
    if not days:
        return 0
    old = Application.finished_at < now() - days * DAY_S
    with reading(engine) as session:
        ids = session.scalars(select(Application.id).where(old).order_by(Application.finished_at).limit(BATCH)).all()
    return sum(_forget(engine, application_id, days) for application_id in ids)


def _forget(engine: Engine, application_id: str, days: float) -> bool:
    """It may have been retried since it was found."""
    with transaction(engine) as session:
        application = lock_application(session, application_id)
        if application is None or not ApplicationState(application.state).final:
            return False
        old = Application.finished_at < now() - days * DAY_S
        statement = delete(Application).where(Application.id == application_id, old).returning(Application.id)
        return session.execute(statement).first() is not None
