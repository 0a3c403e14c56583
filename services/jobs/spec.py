"""What applications mean. What was accepted never changes: a process reads and checks it once, and keeps it."""

from __future__ import annotations

from sqlalchemy import String, bindparam, select
from sqlalchemy.orm import Session

from services.codesign.kept import Kept
from services.jobs.resolved import ResolvedApplication
from shared.db.tables import Application, table_of

MOST_TASKS = 20_000
"""Tasks that a process keeps at hand, of all applications together: about a kilobyte each."""

_STORED = select(table_of(Application).c.resolved).where(
    table_of(Application).c.id == bindparam("of_application", type_=String)
)


_known: Kept[ResolvedApplication] = Kept(MOST_TASKS, weight=lambda resolved: len(resolved.tasks))


def spec_of(session: Session, application_id: str) -> ResolvedApplication | None:
    """What an application means; None when there is no such application, or it was deleted before it was asked for."""
    try:
        return _known.get(application_id, lambda: _read(session, application_id))
    except LookupError:
        return None


def _read(session: Session, application_id: str) -> ResolvedApplication:
    stored = session.scalar(_STORED, {"of_application": application_id})
    if stored is None:
        raise LookupError(f"no application {application_id}")
    return ResolvedApplication.model_validate(stored)
