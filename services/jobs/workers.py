"""Which workers are there: their signs of life, and whether one that is there does anything."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import Engine, delete, func, select, update

from shared.db.clock import now
from shared.db.engine import reading, transaction
from shared.db.tables import Job, Worker
from shared.domain import JobState

FORGOTTEN_S = 24 * 3600.0
"""Silence after which a worker is no longer listed."""


@dataclass(frozen=True)
class WorkerInfo:
    """A worker, seen from the database."""

    name: str
    host: str
    processes: int
    silent_s: float
    running: int  # leases that its processes hold


def sign_of_life(engine: Engine, name: str, host: str, processes: int) -> None:
    """Say that a worker lives."""
    with transaction(engine) as session:
        known = session.execute(update(Worker).where(Worker.name == name).values(seen_at=now()).returning(Worker.name))
        if known.first() is None:
            session.execute(delete(Worker).where(Worker.seen_at < now() - FORGOTTEN_S))
            session.add(Worker(name=name, host=host, processes=processes))


def say_goodbye(engine: Engine, name: str) -> None:
    """A worker ends in order."""
    with transaction(engine) as session:
        session.execute(delete(Worker).where(Worker.name == name))


def list_workers(engine: Engine) -> list[WorkerInfo]:
    """All workers that were seen within a day, by name."""
    with reading(engine) as session:
        rows = session.execute(
            select(Worker.name, Worker.host, Worker.processes, now() - Worker.seen_at).order_by(Worker.name)
        ).all()
        leases = session.execute(
            select(Job.worker, func.count()).where(Job.state == JobState.RUNNING).group_by(Job.worker)
        ).all()
    running: dict[str, int] = {}
    for worker, count in leases:
        host = str(worker).rpartition(":")[0]
        running[host] = running.get(host, 0) + count
    return [WorkerInfo(name, host, count, max(0.0, silent), running.get(host, 0)) for name, host, count, silent in rows]
