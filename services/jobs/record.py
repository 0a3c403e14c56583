"""What every move of one job writes beside the job itself: a line of history, and an event with the next number.

For the two moves that each job makes, claim and finish, as statements that are sent together with the job's own; other
moves come by `services.jobs.store`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, Integer, String, bindparam, delete, insert

from services.jobs.plan import JobSpec
from shared.db.clock import now
from shared.db.tables import Application, Event, Job, JobTransition, table_of
from shared.domain import TRANSITIONS, JobState

APPLICATIONS, EVENTS, JOBS = table_of(Application), table_of(Event), table_of(Job)

LOCKED = [APPLICATIONS, JOBS]
"""For `with_for_update` of a join that asks whether a move may happen. The application first, as everywhere. Both,
because after waiting for a lock Postgres looks again at the rows that it locks and at no others: what such a query
finds is true until the transaction ends."""

MOST_EVENTS = 5000
"""Events kept of one application."""
PRUNE_EVERY = 500

OF_JOB, OF_APPLICATION = bindparam("of_job", type_=String), bindparam("of_application", type_=String)
HELD_TOKEN, EVENT_NUMBER = bindparam("held_token", type_=Integer), bindparam("event_number", type_=Integer)

RECORD = {
    "event": insert(EVENTS).values(
        application_id=OF_APPLICATION,
        number=EVENT_NUMBER,
        kind="job",
        content=bindparam("event_content", type_=EVENTS.c.content.type),
        at=now(),
    ),
    "transition": insert(table_of(JobTransition)).values(
        job_id=OF_JOB,
        application_id=OF_APPLICATION,
        from_state=bindparam("source", type_=String),
        to_state=bindparam("target", type_=String),
        token=HELD_TOKEN,
        worker=bindparam("by", type_=String),
        at=now(),
    ),
}
"""The statements; `recorded` gives their parameters."""


@dataclass(frozen=True)
class Move:
    """A job's way from one state to another."""

    job_id: str
    application_id: str
    spec: JobSpec
    source: JobState
    target: JobState
    token: int
    worker: str

    def parameters(self, event_number: int) -> dict[str, Any]:
        """Parameters of `RECORD`; refuses a transition that does not exist."""
        refuse_unknown(self.job_id, self.source, self.target)
        return {
            "of_job": self.job_id,
            "of_application": self.application_id,
            "event_number": event_number,
            "event_content": job_event(self.job_id, self.spec, self.source, self.target),
            "source": self.source,
            "target": self.target,
            "held_token": self.token,
            "by": self.worker,
        }


def refuse_unknown(job_id: str, source: JobState, target: JobState) -> None:
    """An error in the code must not become one in the history."""
    assert target in TRANSITIONS.get(source, frozenset()), f"job {job_id}: no transition {source} -> {target}"


def job_event(job_id: str, spec: JobSpec, source: JobState, target: JobState) -> dict[str, Any]:
    """What the event of a transition says."""
    place = {"stage": spec.stage, "method": spec.method, "task_index": spec.task_index}
    return {"job_id": job_id, **place, "from": source, "to": target}


def add_event(connection: Connection, application_id: str, number: int, kind: str, content: dict[str, Any]) -> None:
    """An event of another kind; the caller holds the application's lock, and counts."""
    row = {"application_id": application_id, "number": number, "kind": kind, "content": content}
    connection.execute(insert(EVENTS).values(**row, at=now()))
    prune(connection, application_id, number)


def prune(connection: Connection, application_id: str, event_number: int) -> None:
    """After an event: now and then, forget those that are too old."""
    if event_number % PRUNE_EVERY == 0:
        old = EVENTS.c.number <= event_number - MOST_EVENTS
        connection.execute(delete(EVENTS).where(EVENTS.c.application_id == application_id, old))
