"""Record a job's outcome and go on: result, stage counter and next stage in one transaction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Connection, Engine, Integer, String, and_, bindparam, insert, literal, select, update
from sqlalchemy.orm import Session

from services.jobs.claim import Claim
from services.jobs.record import APPLICATIONS, HELD_TOKEN, JOBS, OF_JOB, PLACE, STATE, prune, record, refuse_unknown
from services.jobs.store import advance
from shared.db.clock import now
from shared.db.engine import at_once
from shared.db.tables import Design, Result, Stage, table_of
from shared.db.together import Columns, Statement, WithRow, row_into
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


_STAGES = table_of(Stage)


def _end(job: Columns) -> dict[str, Statement]:
    """What the end of each job writes."""
    target = bindparam("target", type_=String)
    return {
        "job": update(JOBS)
        .where(JOBS.c.id == job["job_id"])
        .values(state=target, reason=bindparam("because", type_=String), lease_until=None, finished_at=now()),
        "remaining": update(_STAGES)
        .where(
            _STAGES.c.application_id == job["application_id"],
            _STAGES.c.generation == job["of_generation"],
            _STAGES.c.name == job["stage"],
        )
        .values(remaining=_STAGES.c.remaining - 1)
        .returning(_STAGES.c.remaining),
        "application": update(APPLICATIONS)
        .where(APPLICATIONS.c.id == job["application_id"])
        .values(last_event=job["last_event"] + 1),
        **record(job, job["token"], literal(JobState.RUNNING, String), target, bindparam("by", type_=String)),
    }


_CONTENT = [table_of(Result).c[name] for name in ("value", "summary", "arrays", "log")]


def _end_with_result(job: Columns) -> dict[str, Statement]:
    """The same, of a job that found something."""
    result = {column.name: job[column.name] for column in PLACE} | {"job_id": job["job_id"]}
    content = {column.name: bindparam(f"its_{column.name}", type_=column.type) for column in _CONTENT}
    return _end(job) | {"result": row_into(Result, result | content)}


_HELD = (
    select(
        JOBS.c.id.label("job_id"),
        *PLACE,
        JOBS.c.token,
        APPLICATIONS.c.generation.label("of_generation"),
        APPLICATIONS.c.last_event,
    )
    .join_from(APPLICATIONS, JOBS, JOBS.c.application_id == APPLICATIONS.c.id)
    .join(
        _STAGES,
        and_(
            _STAGES.c.application_id == APPLICATIONS.c.id,
            _STAGES.c.generation == APPLICATIONS.c.generation,
            _STAGES.c.name == JOBS.c.stage,
        ),
    )
    .where(
        JOBS.c.id == OF_JOB,
        JOBS.c.token == HELD_TOKEN,
        STATE == JobState.RUNNING,
        _STAGES.c.remaining > bindparam("others", type_=Integer),
    )
    .with_for_update(of=[APPLICATIONS, JOBS, _STAGES])
)

_END, _END_WITH_RESULT = WithRow(_HELD, _end), WithRow(_HELD, _end_with_result)


def finish(engine: Engine, held: Claim, outcome: Outcome) -> bool:
    """Record an outcome once; False when the lease was lost meanwhile and the outcome is discarded.

    Most jobs are not the last of their stage, and nothing follows from them: that is one statement.
    """
    assert outcome.state.final
    refuse_unknown(held.job_id, JobState.RUNNING, outcome.state)
    if not outcome.designs:
        with at_once(engine) as connection:
            if _write(connection, held, outcome, others=1) is not None:
                return True
    with engine.begin() as connection:
        remaining = _write(connection, held, outcome, others=0)
        if remaining is None:
            return False
        designs = [{"kind": kind, "content": dict(content)} for kind, content in outcome.designs.items()]
        if designs:
            of_generation = {"application_id": held.application_id, "generation": held.generation}
            connection.execute(insert(table_of(Design)), [of_generation | design for design in designs])
        if remaining == 0:
            with Session(connection) as session:
                advance(session, held.application_id, held.spec.stage)
        return True


def _write(connection: Connection, held: Claim, outcome: Outcome, others: int) -> int | None:
    """Write what the end of each job writes, if at least so many `others` of its stage are out.

    Returns how many of the stage are out now; None: fewer, or the lease was lost, and nothing was written.
    """
    lease = {"of_job": held.job_id, "held_token": held.token, "by": held.worker, "others": others}
    values = lease | {"target": outcome.state, "because": outcome.reason}
    if outcome.summary:
        content = {"value": outcome.value, "summary": dict(outcome.summary), "arrays": outcome.arrays}
        values |= {f"its_{name}": value for name, value in content.items()} | {"its_log": list(outcome.log)}
    done = (_END_WITH_RESULT if outcome.summary else _END).run(connection, values)
    if done is None:
        return None
    prune(connection, held.application_id, done["last_event"] + 1)
    return int(done["remaining"])
