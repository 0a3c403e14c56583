"""A database with a hundred thousand jobs: one application worked through, and copied within the database."""

from __future__ import annotations

from typing import Any, Final

from sqlalchemy import ColumnElement, Engine, String, Table, cast, insert, literal, select, text, true
from sqlalchemy.orm import Session

from services.jobs.submit import submit
from shared.contracts.application import ApplicationRequest
from shared.db.engine import transaction
from shared.db.tables import Application, Base, BigId, Event, Job
from shared.settings import Settings
from tests.service.queue_actions import drain

TASKS: Final = 50
JOBS_EACH: Final = TASKS + 1 + TASKS
"""Co-designs, one reconcile, motions."""

SIX_DIGITS: Final = 100_000

IDS: Final = frozenset({"id", "job_id", "application_id"})
ALONE: Final = frozenset({"idempotency_key"})
"""Unique, and so left out of copies."""


def fill(engine: Engine, settings: Settings, applications: int) -> str:
    """Store so many finished applications of 101 jobs each; returns the id of the first of them."""
    original, _ = submit(engine, settings, request())
    drain(engine)
    with transaction(engine) as session:
        for table in Base.metadata.sorted_tables:
            if (own := _of(table, original)) is not None:
                _copy(session, table, own, applications)
    with engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
        connection.execute(text("ANALYZE"))  # as a server does by itself after a while
    return original


def request(**changes: Any) -> ApplicationRequest:
    """An application of 101 jobs."""
    stroke = [0.1 + 0.01 * k for k in range(TASKS)]
    tasks = {"grid": {"stroke": stroke, "payload_kg": [1.0]}}
    return ApplicationRequest.model_validate({"name": "many", "tasks": tasks, **changes})


def _of(table: Table, application_id: str) -> ColumnElement[bool] | None:
    """Which rows of a table belong to an application; None: none ever do."""
    if table is Event.__table__:
        return None  # found by application and number alone, and half of all rows
    if table is Application.__table__:
        return table.c.id == application_id
    if "application_id" in table.columns:
        return table.c.application_id == application_id
    if "job_id" in table.columns:
        return table.c.job_id.in_(select(Job.id).where(Job.application_id == application_id))
    return None


def _copy(session: Session, table: Table, own: ColumnElement[bool], times: int) -> None:
    numbers = select(literal(1).label("k")).cte("numbers", recursive=True)
    numbers = numbers.union_all(select(numbers.c.k + 1).where(numbers.c.k < times - 1))
    prefix = cast(numbers.c.k + SIX_DIGITS, String) + ":"
    copied = [column for column in table.columns if column.name not in ALONE and not _counted(column)]
    values = [prefix + column if column.name in IDS else column for column in copied]
    rows = select(*values).select_from(table.join(numbers, true())).where(own)
    session.execute(insert(table).from_select([column.name for column in copied], rows))


def _counted(column: Any) -> bool:
    """Whether the database numbers the rows itself."""
    return column.primary_key and column.autoincrement is True and column.type is BigId
