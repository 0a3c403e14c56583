"""Record a job's outcome and go on: result, stage counter and next stage in one transaction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Connection, Engine, Insert, Integer, String, Update, bindparam, insert, select, update
from sqlalchemy.orm import Session

from services.jobs.claim import Claim
from services.jobs.record import (
    APPLICATIONS,
    EVENT_NUMBER,
    HELD_TOKEN,
    JOBS,
    LOCKED,
    OF_APPLICATION,
    OF_JOB,
    RECORD,
    Move,
    prune,
)
from services.jobs.store import advance
from shared.db.clock import now
from shared.db.tables import Design, Result, Stage, table_of
from shared.db.together import Together
from shared.domain import JobState


@dataclass(frozen=True)
class Outcome:
    """What came of a job."""

    state: JobState  # SUCCEEDED, FAILED or CANCELLED
    reason: str | None = None
    value: float | None = None  # the objective [s or V2 s]
    summary: Mapping[str, Any] = field(default_factory=dict)
    arrays: bytes | None = None
    log: Sequence[tuple[int, int, float]] = ()  # attempt, iteration, objective
    designs: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # kind -> content


_HELD = (
    select(APPLICATIONS.c.last_event, APPLICATIONS.c.generation)
    .join(JOBS, JOBS.c.application_id == APPLICATIONS.c.id)
    .where(JOBS.c.id == OF_JOB, JOBS.c.token == HELD_TOKEN, JOBS.c.state == JobState.RUNNING)
    .with_for_update(of=LOCKED)
)

_STAGES = table_of(Stage)

_END: dict[str, Insert | Update] = {
    "job": update(JOBS)
    .where(JOBS.c.id == OF_JOB, JOBS.c.token == HELD_TOKEN, JOBS.c.state == JobState.RUNNING)
    .values(
        state=bindparam("target", type_=String),
        reason=bindparam("because", type_=String),
        lease_until=None,
        finished_at=now(),
    ),
    "remaining": update(_STAGES)
    .where(
        _STAGES.c.application_id == OF_APPLICATION,
        _STAGES.c.generation == bindparam("of_generation", type_=Integer),
        _STAGES.c.name == bindparam("of_stage", type_=String),
    )
    .values(remaining=_STAGES.c.remaining - 1)
    .returning(_STAGES.c.remaining),
    "application": update(APPLICATIONS).where(APPLICATIONS.c.id == OF_APPLICATION).values(last_event=EVENT_NUMBER),
    **RECORD,
}

_RESULT: dict[str, Insert | Update] = {
    "result": insert(table_of(Result)).values(
        {column: bindparam(f"its_{column.name}", type_=column.type) for column in table_of(Result).c}
    )
}

_END_WITHOUT_RESULT, _END_WITH_RESULT = Together(**_END), Together(**_END, **_RESULT)


def finish(engine: Engine, held: Claim, outcome: Outcome) -> bool:
    """Record an outcome once; False when the lease was lost meanwhile and the outcome is discarded."""
    with engine.begin() as connection:
        lease = {"of_job": held.job_id, "held_token": held.token}
        application = connection.execute(_HELD, lease).one_or_none()
        if application is None:
            return False
        number = application.last_event + 1
        remaining = _end(connection, held, outcome, application.generation, number)
        prune(connection, held.application_id, number)
        designs = [{"kind": kind, "content": dict(content)} for kind, content in outcome.designs.items()]
        if designs:
            of_generation = {"application_id": held.application_id, "generation": held.generation}
            connection.execute(insert(table_of(Design)), [of_generation | design for design in designs])
        if remaining == 0:
            with Session(connection) as session:
                advance(session, held.application_id, held.spec.stage)
        return True


def _end(connection: Connection, held: Claim, outcome: Outcome, generation: int, number: int) -> int:
    """Write what the end of each job writes; returns how many jobs of its stage are still out."""
    assert outcome.state.final
    move = Move(held.job_id, held.application_id, held.spec, JobState.RUNNING, outcome.state, held.token, held.worker)
    of_stage = {"of_generation": generation, "of_stage": held.spec.stage}
    values = move.parameters(number) | of_stage | {"because": outcome.reason}
    if outcome.summary:
        answers = _END_WITH_RESULT.run(connection, values | _result(held, outcome))
    else:
        answers = _END_WITHOUT_RESULT.run(connection, values)
    return int(answers["remaining"])


def _result(held: Claim, outcome: Outcome) -> dict[str, Any]:
    result = {
        "job_id": held.job_id,
        "application_id": held.application_id,
        "generation": held.generation,
        "stage": held.spec.stage,
        "method": held.spec.method,
        "task_index": held.spec.task_index,
        "value": outcome.value,
        "summary": dict(outcome.summary),
        "arrays": outcome.arrays,
        "log": list(outcome.log),
    }
    return {f"its_{name}": value for name, value in result.items()}
