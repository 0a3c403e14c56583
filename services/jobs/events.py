"""What happened to an application since an event, for people who follow it live."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Engine, select

from services.jobs.views import NotFoundError
from shared.db.engine import reading
from shared.db.tables import Application, Event
from shared.domain import ApplicationState

BATCH = 500


@dataclass(frozen=True)
class NumberedEvent:
    """One event; numbers grow by one."""

    number: int
    kind: str
    content: dict[str, Any]


@dataclass(frozen=True)
class Events:
    """Events after a number, and whether more can follow."""

    items: list[NumberedEvent]
    pruned: bool  # events right after the number are gone
    ended: bool  # the application is final, and these are the last


def events_after(engine: Engine, application_id: str, number: int) -> Events:
    """Events `number` + 1, ...

    Raises
    ------
    NotFoundError
    """
    with reading(engine) as session:
        application = session.get(Application, application_id)
        if application is None:
            raise NotFoundError(f"there is no application {application_id}")
        rows = session.scalars(
            select(Event)
            .where(Event.application_id == application_id, Event.number > number)
            .order_by(Event.number)
            .limit(BATCH)
        ).all()
        items = [_event(row) for row in rows]
        last = items[-1].number if items else number
        return Events(
            items=items,
            pruned=bool(items) and items[0].number > number + 1,
            ended=ApplicationState(application.state).final and last >= application.last_event,
        )


def _event(row: Event) -> NumberedEvent:
    at = datetime.fromtimestamp(row.at, UTC).isoformat(timespec="milliseconds")
    return NumberedEvent(row.number, row.kind, {"at": at, **row.content})
