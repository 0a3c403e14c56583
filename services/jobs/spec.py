"""What applications mean. What was accepted never changes: a process reads and checks it once, and keeps it."""

from __future__ import annotations

from collections import OrderedDict
from threading import Lock

from sqlalchemy import String, bindparam, select
from sqlalchemy.orm import Session

from services.jobs.resolved import ResolvedApplication
from shared.db.tables import Application, table_of

MOST_TASKS = 20_000
"""Tasks that a process keeps at hand, of all applications together: about a kilobyte each."""

_STORED = select(table_of(Application).c.resolved).where(
    table_of(Application).c.id == bindparam("of_application", type_=String)
)


class Kept:
    """The applications that were asked for last, with at most so many tasks together; for any number of threads."""

    def __init__(self, most_tasks: int) -> None:
        self._most, self._tasks, self._lock = most_tasks, 0, Lock()
        self._specs: OrderedDict[str, ResolvedApplication] = OrderedDict()

    def get(self, application_id: str) -> ResolvedApplication | None:
        """What is known, and from now on the last to be forgotten."""
        with self._lock:
            if application_id in self._specs:
                self._specs.move_to_end(application_id)
            return self._specs.get(application_id)

    def put(self, application_id: str, spec: ResolvedApplication) -> None:
        """Keep one, and forget those that were not asked for the longest."""
        with self._lock:
            if application_id in self._specs:
                return
            self._specs[application_id] = spec
            self._tasks += len(spec.tasks)
            while self._tasks > self._most and len(self._specs) > 1:
                self._tasks -= len(self._specs.popitem(last=False)[1].tasks)


_kept = Kept(MOST_TASKS)


def spec_of(session: Session, application_id: str) -> ResolvedApplication | None:
    """What an application means; None when there is no such application, or it was deleted before it was asked for."""
    known = _kept.get(application_id)
    if known is None:
        stored = session.scalar(_STORED, {"of_application": application_id})
        if stored is None:
            return None
        known = ResolvedApplication.model_validate(stored)
        _kept.put(application_id, known)
    return known
