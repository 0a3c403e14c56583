"""What every move of one job writes beside the job itself: a line of history, and an event with the next number.

For the two moves that each job makes, claim and finish, as statements that are sent together with the job's own; other
moves come by `services.jobs.store`. Both lock the application first and then the job, as everywhere.
"""

from __future__ import annotations

from typing import Any

from sqlalchemy import ColumnElement, Connection, Integer, String, bindparam, delete, literal

from services.jobs.plan import JobSpec
from shared.db.clock import now
from shared.db.documents import json_object
from shared.db.tables import Application, Event, Job, JobTransition, table_of
from shared.db.together import Columns, Statement, row_into
from shared.domain import TRANSITIONS, JobState

APPLICATIONS, EVENTS, JOBS = table_of(Application), table_of(Event), table_of(Job)

MOST_EVENTS = 5000
"""Events kept of one application."""
PRUNE_EVERY = 500

OF_JOB, OF_APPLICATION = bindparam("of_job", type_=String), bindparam("of_application", type_=String)
HELD_TOKEN, EVENT_NUMBER = bindparam("held_token", type_=Integer), bindparam("event_number", type_=Integer)

PLACE = [JOBS.c[name] for name in ("application_id", "generation", "stage", "method", "task_index")]
"""Where a job belongs."""

STATE = JOBS.c.state.concat("")
"""Of a job that is found by its id. The bare column would do, but a database that knows nothing of its tables yet may
look for the state first, and read every job that waits."""


def record(
    job: Columns,
    token: ColumnElement[int],
    source: ColumnElement[str],
    target: ColumnElement[str],
    worker: ColumnElement[str],
) -> dict[str, Statement]:
    """The statements, of a row that has the job's `job_id` and `PLACE`, and its application's `last_event`."""
    told = {name: job[name] for name in ("job_id", "stage", "method", "task_index")}
    event = {
        "application_id": job["application_id"],
        "number": job["last_event"] + 1,
        "kind": literal("job", String),
        "content": json_object({**told, "from": source, "to": target}),
        "at": now(),
    }
    transition = {
        "job_id": job["job_id"],
        "application_id": job["application_id"],
        "from_state": source,
        "to_state": target,
        "token": token,
        "worker": worker,
        "at": now(),
    }
    return {"event": row_into(Event, event), "transition": row_into(JobTransition, transition)}


def refuse_unknown(job_id: str, source: JobState, target: JobState) -> None:
    """An error in the code must not become one in the history."""
    assert target in TRANSITIONS.get(source, frozenset()), f"job {job_id}: no transition {source} -> {target}"


def job_event(job_id: str, spec: JobSpec, source: JobState, target: JobState) -> dict[str, Any]:
    """What the event of a transition says."""
    place = {"stage": spec.stage, "method": spec.method, "task_index": spec.task_index}
    return {"job_id": job_id, **place, "from": source, "to": target}


def prune(connection: Connection, application_id: str, event_number: int) -> None:
    """After an event: now and then, forget those that are too old."""
    if event_number % PRUNE_EVERY == 0:
        old = EVENTS.c.number <= event_number - MOST_EVENTS
        connection.execute(delete(EVENTS).where(EVENTS.c.application_id == application_id, old))
