"""Begin a stage: its counter, its jobs and their messages, by statements that are the same for any number of jobs.

The first stage is begun together with its application, which is new.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from sqlalchemy import ColumnElement, Connection, Insert, Integer, String, bindparam, false, insert, literal, select
from sqlalchemy.orm import Session

from services.jobs.plan import NextStage
from services.jobs.record import APPLICATIONS, EVENT_NUMBER, EVENTS, JOBS, OF_APPLICATION, prune
from shared.db.clock import now
from shared.db.rows import entry
from shared.db.tables import Application, Outbox, Stage, table_of
from shared.db.together import Together
from shared.domain import ApplicationState, JobState, new_id

_OF_GENERATION, _OF_STAGE = bindparam("of_generation", type_=Integer), bindparam("of_stage", type_=String)
_TOTAL = bindparam("total", type_=Integer)
_JOB = entry("jobs_to_do")  # id, method, task index

_NEW_JOB: dict[str, ColumnElement[Any]] = {
    "id": _JOB[0].as_string(),
    "method": _JOB[1].as_string(),
    "task_index": _JOB[2].as_integer(),
    "application_id": OF_APPLICATION,
    "generation": _OF_GENERATION,
    "stage": _OF_STAGE,
    "round": literal(0),
    "state": literal(JobState.QUEUED, String),
    "attempts": literal(0),
    "token": literal(0),
    "stop_requested": false(),
    "created_at": now(),
}
"""Column by column; the tables' defaults are for one row at a time."""

_STAGE: dict[str, Insert] = {
    "stage": insert(table_of(Stage)).values(
        application_id=OF_APPLICATION, generation=_OF_GENERATION, name=_OF_STAGE, total=_TOTAL, remaining=_TOTAL
    ),
    "jobs": insert(JOBS).from_select(list(_NEW_JOB), select(*_NEW_JOB.values()), include_defaults=False),
    "messages": insert(table_of(Outbox)).from_select(
        ["job_id", "due_at", "sent"], select(_JOB[0].as_string(), now(), literal(0)), include_defaults=False
    ),
    "event": insert(EVENTS).values(
        application_id=OF_APPLICATION,
        number=EVENT_NUMBER,
        kind="stage",
        content=bindparam("event_content", type_=EVENTS.c.content.type),
        at=now(),
    ),
}


@dataclass(frozen=True)
class NewApplication:
    """An application that is not in the database yet: what its row says that is not the same for all new ones."""

    id: str
    name: str
    request: dict[str, Any]
    resolved: dict[str, Any]
    versions: dict[str, str]
    tags: list[str]
    request_hash: str
    idempotency_key: str | None
    owner: str | None
    """As in `services.jobs.owners`."""


_GIVEN = [field.name for field in fields(NewApplication)]

_FIRST_EVENT = 1

_APPLICATION = insert(APPLICATIONS).values(
    {name: bindparam(f"its_{name}", type_=APPLICATIONS.c[name].type) for name in _GIVEN}
    | {
        "state": literal(ApplicationState.QUEUED, String),
        "generation": literal(0),
        "cancel_requested": false(),
        "last_event": literal(_FIRST_EVENT),
        "created_at": now(),
    }
)

_OPEN = Together(**_STAGE)
_OPEN_FIRST = Together(application=_APPLICATION, **_STAGE)


def open_first(connection: Connection, new: NewApplication, stage: NextStage) -> None:
    """Create an application with its first stage."""
    row = {f"its_{name}": getattr(new, name) for name in _GIVEN}
    _OPEN_FIRST.run(connection, row | _values(new.id, 0, stage, _FIRST_EVENT))


def open_stage(session: Session, application: Application, stage: NextStage) -> None:
    """Create a stage of an application, which is new or locked by the caller's transaction."""
    application.last_event += 1
    session.flush()
    connection = session.connection()
    _OPEN.run(connection, _values(application.id, application.generation, stage, application.last_event))
    prune(connection, application.id, application.last_event)


def _values(application_id: str, generation: int, stage: NextStage, event_number: int) -> dict[str, Any]:
    """Parameters of `_STAGE`."""
    ids = sorted(new_id() for _ in stage.jobs)  # messages go out in their order: that of the tasks
    total = len(stage.jobs)
    return {
        "of_application": application_id,
        "of_generation": generation,
        "of_stage": stage.stage,
        "total": total,
        "jobs_to_do": [(job_id, spec.method, spec.task_index) for job_id, spec in zip(ids, stage.jobs, strict=True)],
        "event_number": event_number,
        "event_content": {"stage": stage.stage, "jobs": total},
    }
