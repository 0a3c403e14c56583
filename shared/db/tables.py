"""The tables. The database is the truth; messages are only wake-ups (docs/decisions/0002-database-is-the-truth.md).

All times are seconds since 1970 by the database's clock (`shared.db.clock.now`).
"""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    JSON,
    BigInteger,
    Float,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Table,
    Text,
    UniqueConstraint,
    false,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

from shared.db.clock import now

BigId = BigInteger().with_variant(Integer, "sqlite")


class Base(DeclarativeBase):
    """Declarative base; named constraints, so that migrations can name them."""

    metadata = MetaData(
        naming_convention={
            "ix": "ix_%(column_0_label)s",
            "uq": "uq_%(table_name)s_%(column_0_N_name)s",
            "ck": "ck_%(table_name)s_%(constraint_name)s",
            "fk": "fk_%(table_name)s_%(column_0_name)s_%(referred_table_name)s",
            "pk": "pk_%(table_name)s",
        }
    )
    type_annotation_map = {float: Float(53), dict[str, Any]: JSON, list[str]: JSON}  # noqa: RUF012


def table_of(entity: type[Base]) -> Table:
    """The table itself, for statements that need no objects."""
    assert isinstance(entity.__table__, Table)
    return entity.__table__


def _application_id() -> Mapped[str]:
    return mapped_column(ForeignKey("applications.id", ondelete="CASCADE"))


class Application(Base):
    """What was submitted, what became of it."""

    __tablename__ = "applications"
    __table_args__ = (
        Index("ix_applications_state_id", "state", "id"),
        Index("ix_applications_owner_id", "owner", "id"),
        Index("ix_applications_finished_at", "finished_at"),
    )

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    name: Mapped[str] = mapped_column(String(200))
    state: Mapped[str] = mapped_column(String(32))
    generation: Mapped[int] = mapped_column(default=0)
    """Counts retries; jobs of older generations are history."""
    cancel_requested: Mapped[bool] = mapped_column(default=False)
    last_event: Mapped[int] = mapped_column(default=0)
    """Number of its latest event; taken under the row's lock, so that there is no gap and no double."""
    request: Mapped[dict[str, Any]]
    """As submitted."""
    resolved: Mapped[dict[str, Any]]
    """With every default filled in: robot, motor and tasks explicit; all that a job needs to know."""
    versions: Mapped[dict[str, Any]]
    tags: Mapped[list[str]]
    idempotency_key: Mapped[str | None] = mapped_column(String(200), unique=True)
    request_hash: Mapped[str] = mapped_column(String(64))
    reason: Mapped[str | None] = mapped_column(Text)
    created_at: Mapped[float] = mapped_column(default=now())
    started_at: Mapped[float | None]
    finished_at: Mapped[float | None]
    owner: Mapped[str | None] = mapped_column(String(32))
    """The API key that submitted it (`services.jobs.owners`); null where no keys are asked for."""


class Stage(Base):
    """How many jobs of a stage are still out: decremented once by each job's transition into a final state."""

    __tablename__ = "stages"

    application_id: Mapped[str] = mapped_column(ForeignKey("applications.id", ondelete="CASCADE"), primary_key=True)
    generation: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(String(32), primary_key=True)
    total: Mapped[int]
    remaining: Mapped[int]


class Job(Base):
    """One piece of work. A claim is a lease on it, proved by the fencing token."""

    __tablename__ = "jobs"
    __table_args__ = (
        UniqueConstraint(
            "application_id", "generation", "stage", "method", "task_index", "round", name="uq_jobs_place"
        ),
        Index("ix_jobs_state_lease_until", "state", "lease_until"),
    )

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    application_id: Mapped[str] = _application_id()
    generation: Mapped[int]
    stage: Mapped[str] = mapped_column(String(32))
    method: Mapped[str] = mapped_column(String(32))
    task_index: Mapped[int]
    round: Mapped[int] = mapped_column(default=0)
    state: Mapped[str] = mapped_column(String(32))
    attempts: Mapped[int] = mapped_column(default=0)
    token: Mapped[int] = mapped_column(default=0)
    """Fencing token: grows with every claim, never shrinks. A finish with an older one is refused."""
    lease_until: Mapped[float | None]
    worker: Mapped[str | None] = mapped_column(String(200))
    stop_requested: Mapped[bool] = mapped_column(default=False, server_default=false())
    """Whether its search is to end with the best that it has (`services.jobs.stop_search`)."""
    reason: Mapped[str | None] = mapped_column(Text)
    created_at: Mapped[float] = mapped_column(default=now())
    started_at: Mapped[float | None]
    finished_at: Mapped[float | None]


class Result(Base):
    """What a solve gave: numbers people ask for as JSON, arrays compact in one column."""

    __tablename__ = "results"
    __table_args__ = (Index("ix_results_application_id", "application_id", "generation", "stage", "task_index"),)

    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True)
    application_id: Mapped[str] = _application_id()
    generation: Mapped[int]
    stage: Mapped[str] = mapped_column(String(32))
    method: Mapped[str] = mapped_column(String(32))
    task_index: Mapped[int]
    value: Mapped[float | None]
    """The objective, for progress displays [s or V2 s]."""
    summary: Mapped[dict[str, Any]]
    log: Mapped[list[Any]] = mapped_column(JSON)
    """Solver iterations: [attempt, iteration, objective]; bounded (`services.jobs.execute`)."""
    arrays: Mapped[bytes | None] = mapped_column(LargeBinary)
    """The motion as a compressed NumPy archive (`services.jobs.arrays`)."""


class Event(Base):
    """What happened to an application, numbered; the oldest are pruned."""

    __tablename__ = "events"

    application_id: Mapped[str] = mapped_column(ForeignKey("applications.id", ondelete="CASCADE"), primary_key=True)
    number: Mapped[int] = mapped_column(primary_key=True)
    kind: Mapped[str] = mapped_column(String(32))
    content: Mapped[dict[str, Any]]
    at: Mapped[float] = mapped_column(default=now())


class Design(Base):
    """A design that the tasks share: the mean, or the design of a method."""

    __tablename__ = "designs"

    application_id: Mapped[str] = mapped_column(ForeignKey("applications.id", ondelete="CASCADE"), primary_key=True)
    generation: Mapped[int] = mapped_column(primary_key=True)
    kind: Mapped[str] = mapped_column(String(32), primary_key=True)
    content: Mapped[dict[str, Any]]


class Outbox(Base):
    """Messages to be sent, written in the transaction that makes them necessary."""

    __tablename__ = "outbox"
    __table_args__ = (Index("ix_outbox_due_at", "due_at"),)

    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True)
    due_at: Mapped[float | None] = mapped_column(default=now())
    """When to send (again); null while the job needs no message."""
    sent: Mapped[int] = mapped_column(default=0)


class JobTransition(Base):
    """Append-only history of every job."""

    __tablename__ = "job_transitions"
    __table_args__ = (Index("ix_job_transitions_job_id", "job_id"),)

    id: Mapped[int] = mapped_column(BigId, primary_key=True, autoincrement=True)
    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id", ondelete="CASCADE"))
    application_id: Mapped[str] = mapped_column(ForeignKey("applications.id", ondelete="CASCADE"), index=True)
    from_state: Mapped[str] = mapped_column(String(32))
    to_state: Mapped[str] = mapped_column(String(32))
    token: Mapped[int]
    worker: Mapped[str | None] = mapped_column(String(200))
    at: Mapped[float] = mapped_column(default=now())


class Sweep(Base):
    """A base application and axes over its fields; each combination is an application of its own."""

    __tablename__ = "sweeps"
    __table_args__ = (Index("ix_sweeps_owner_id", "owner", "id"),)

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    name: Mapped[str] = mapped_column(String(200))
    request: Mapped[dict[str, Any]]
    """As submitted."""
    tags: Mapped[list[str]]
    idempotency_key: Mapped[str | None] = mapped_column(String(200), unique=True)
    request_hash: Mapped[str] = mapped_column(String(64))
    created_at: Mapped[float] = mapped_column(default=now())
    owner: Mapped[str | None] = mapped_column(String(32))
    """As an application's."""


class SweepPoint(Base):
    """One combination of a sweep's values, and its application."""

    __tablename__ = "sweep_points"

    sweep_id: Mapped[str] = mapped_column(ForeignKey("sweeps.id", ondelete="CASCADE"), primary_key=True)
    position: Mapped[int] = mapped_column(primary_key=True)
    application_id: Mapped[str] = mapped_column(ForeignKey("applications.id", ondelete="CASCADE"), unique=True)
    axis_values: Mapped[dict[str, Any]]
    """Value by axis."""


class UploadedRobot(Base):
    """A robot that someone uploaded."""

    __tablename__ = "robots"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    name: Mapped[str] = mapped_column(String(200))
    wire: Mapped[dict[str, Any]]
    created_at: Mapped[float] = mapped_column(default=now())
    owner: Mapped[str | None] = mapped_column(String(32))
    """As an application's."""


class ApiKey(Base):
    """Who may ask. A key itself is random enough that a fast hash of it cannot be turned back; only that is kept."""

    __tablename__ = "api_keys"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    name: Mapped[str] = mapped_column(String(200))
    hash: Mapped[str] = mapped_column(String(64), unique=True)
    created_at: Mapped[float] = mapped_column(default=now())
    revoked_at: Mapped[float | None]


class BrowserSession(Base):
    """A browser that showed a key once; ends with its time, with a logout, or with the key."""

    __tablename__ = "sessions"

    hash: Mapped[str] = mapped_column(String(64), primary_key=True)
    key_id: Mapped[str] = mapped_column(ForeignKey("api_keys.id", ondelete="CASCADE"), index=True)
    expires_at: Mapped[float]


class Tally(Base):
    """Counts for the metrics, kept when what was counted is deleted (`services.jobs.tally`)."""

    __tablename__ = "tallies"

    name: Mapped[str] = mapped_column(String(100), primary_key=True)
    value: Mapped[float] = mapped_column(default=0.0)


class Worker(Base):
    """A worker's sign of life, one row a process that holds a pool; removed when it has been silent for long."""

    __tablename__ = "workers"

    name: Mapped[str] = mapped_column(String(200), primary_key=True)
    """Host and process id."""
    host: Mapped[str] = mapped_column(String(200))
    processes: Mapped[int]
    started_at: Mapped[float] = mapped_column(default=now())
    seen_at: Mapped[float] = mapped_column(default=now())
