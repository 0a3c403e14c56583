"""Record a job's outcome and go on: result, stage counter and next stage in one transaction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Engine

from services.jobs.claim import Claim
from services.jobs.store import lock_application, settle
from shared.db.engine import transaction
from shared.db.tables import Design, Job, Result
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


def finish(engine: Engine, held: Claim, outcome: Outcome) -> bool:
    """Record an outcome once; False when the lease was lost meanwhile and the outcome is discarded."""
    with transaction(engine) as session:
        application = lock_application(session, held.application_id)
        job = session.get(Job, held.job_id, populate_existing=True)
        if application is None or job is None or job.token != held.token or job.state != JobState.RUNNING:
            return False
        key = {"application_id": job.application_id, "generation": job.generation}
        if outcome.summary:
            session.add(_result(job, outcome))
        session.add_all(Design(**key, kind=kind, content=dict(content)) for kind, content in outcome.designs.items())
        session.flush()
        settle(session, application, [job], outcome.state, outcome.reason)
        return True


def _result(job: Job, outcome: Outcome) -> Result:
    return Result(
        job_id=job.id,
        application_id=job.application_id,
        generation=job.generation,
        stage=job.stage,
        method=job.method,
        task_index=job.task_index,
        value=outcome.value,
        summary=dict(outcome.summary),
        arrays=outcome.arrays,
        log=list(outcome.log),
    )
