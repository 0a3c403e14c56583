"""Counters for the metrics, from the append-only history.

A scrape must not read 100,000 rows, and a counter must not fall when an application is deleted. So whoever sweeps adds
what is new in `job_transitions` to running sums, once each: transitions are taken in the order of their numbers up to
the first that is younger than `SETTLED_S`, since a transaction with a lower number may not have committed yet.
What is deleted within that time is not counted.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

from sqlalchemy import Engine, Row, select
from sqlalchemy.orm import Session

from shared.db.clock import now
from shared.db.engine import reading, transaction
from shared.db.tables import JobTransition, Result, Tally
from shared.domain import JobState

SETTLED_S = 5.0
BATCH = 5000
SWEEP = "sweep"
"""Who made a transition, when it was the sweep of expired leases."""

SOLVE_SECONDS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Upper ends of the histogram's buckets [s]; the last one has none."""

CURSOR = "cursor"
LEASE_EXPIRIES = "lease_expiries"
SOLVE_SUM = "solve_seconds_sum"


@dataclass(frozen=True)
class Tallies:
    """Sums since the tables were made."""

    transitions: dict[tuple[str, str], float]  # (from, to) -> jobs
    lease_expiries: float
    solve_buckets: list[float]  # solves in each bucket, not cumulated; one more than `SOLVE_SECONDS`
    solve_seconds: float


def tally(engine: Engine, settled_s: float = SETTLED_S) -> int:
    """Count what is new in the history; returns how many transitions. Any number of processes may."""
    with reading(engine) as session:
        if not _new(session, _cursor(session), settled_s):
            return 0
    with transaction(engine) as session:
        if session.get(Tally, CURSOR) is None:
            session.add(Tally(name=CURSOR, value=0.0))
            session.flush()
        cursor = session.get_one(Tally, CURSOR, with_for_update=True, populate_existing=True)
        rows = _new(session, int(cursor.value), settled_s)
        for name, amount in _sums(rows).items():
            session.merge(Tally(name=name, value=amount + _value(session, name)))
        if rows:
            cursor.value = float(rows[-1].id)
        return len(rows)


def read_tallies(engine: Engine) -> Tallies:
    """The sums so far: a few dozen rows."""
    with reading(engine) as session:
        values = dict(session.execute(select(Tally.name, Tally.value)).all())
    buckets = [values.get(_bucket(k), 0.0) for k in range(len(SOLVE_SECONDS) + 1)]
    transitions = {
        (source, to): value
        for name, value in values.items()
        for kind, _, rest in [name.partition(":")]
        if kind == "transition"
        for source, _, to in [rest.partition(":")]
    }
    return Tallies(transitions, values.get(LEASE_EXPIRIES, 0.0), buckets, values.get(SOLVE_SUM, 0.0))


def _new(session: Session, cursor: int, settled_s: float) -> list[Row[int, str, str, str | None, float, float]]:
    rows = session.execute(
        select(
            JobTransition.id,
            JobTransition.from_state,
            JobTransition.to_state,
            JobTransition.worker,
            now() - JobTransition.at,
            Result.summary["solve_time_s"].as_float(),
        )
        .outerjoin(Result, Result.job_id == JobTransition.job_id)
        .where(JobTransition.id > cursor)
        .order_by(JobTransition.id)
        .limit(BATCH)
    ).all()
    young = next((k for k, row in enumerate(rows) if row[4] < settled_s), len(rows))
    return list(rows[:young])


def _sums(rows: list[Row[int, str, str, str | None, float, float]]) -> dict[str, float]:
    sums: dict[str, float] = defaultdict(float)
    for _, source, to, worker, _, seconds in rows:
        sums[f"transition:{source}:{to}"] += 1
        if to == JobState.DEAD or worker == SWEEP:
            sums[LEASE_EXPIRIES] += 1
        if source == JobState.RUNNING and to in (JobState.SUCCEEDED, JobState.FAILED) and seconds is not None:
            sums[_bucket(sum(seconds > bound for bound in SOLVE_SECONDS))] += 1
            sums[SOLVE_SUM] += seconds
    return sums


def _bucket(k: int) -> str:
    return f"solve_seconds:{k}"


def _cursor(session: Session) -> int:
    return int(_value(session, CURSOR))


def _value(session: Session, name: str) -> float:
    return session.scalar(select(Tally.value).where(Tally.name == name)) or 0.0
