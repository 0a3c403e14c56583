"""How long the queue is."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import Engine, func, select

from shared.db.clock import now
from shared.db.engine import reading
from shared.db.tables import Job
from shared.domain import JobState


@dataclass(frozen=True)
class QueueDepth:
    """Jobs that wait or run."""

    queued: int
    running: int
    oldest_queued_age_s: float  # 0 when nothing waits


def queue_depth(engine: Engine) -> QueueDepth:
    """Count by state; both states are indexed and small beside the finished jobs."""
    with reading(engine) as session:
        counts = dict(
            session.execute(
                select(Job.state, func.count())
                .where(Job.state.in_([JobState.QUEUED, JobState.RUNNING]))
                .group_by(Job.state)
            ).all()
        )
        age = session.scalar(select(now() - func.min(Job.created_at)).where(Job.state == JobState.QUEUED))
    return QueueDepth(counts.get(JobState.QUEUED, 0), counts.get(JobState.RUNNING, 0), max(0.0, age or 0.0))
