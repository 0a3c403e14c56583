"""Engines and transactions, the same for SQLite and Postgres."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from pydantic_core import from_json, to_json
from sqlalchemy import Connection, Engine, create_engine, event, make_url
from sqlalchemy.orm import Session

SQLITE_BUSY_TIMEOUT_S = 30

POSTGRES_CONNECTION = {
    "connect_timeout": 10,  # s
    "keepalives_idle": 10,  # s of silence before the first question
    "keepalives_interval": 5,  # s
    "keepalives_count": 4,
    "tcp_user_timeout": 30_000,  # ms that something sent may stay unacknowledged (Linux)
}
"""A host that vanished is noticed within 30 s; the system's own defaults take hours. What a URL says goes first."""

IDLE_IN_TRANSACTION_S = 30
"""Postgres ends a transaction in which nothing has happened for so long: its process is frozen or its host is gone, and
the rows that it locked are free again. No transaction here waits for anything but the database."""


def _as_text(value: Any) -> str:
    """JSON as the standard library writes it, but for spaces, in an eighth of its time."""
    return to_json(value, inf_nan_mode="constants").decode()


JSON_COLUMNS: dict[str, Any] = {"json_serializer": _as_text, "json_deserializer": from_json}


def make_engine(url: str, *, asks_first: bool = True, outlives_power: bool = False) -> Engine:
    """Create an engine. For SQLite: WAL, one writer at a time, and a wait instead of a lock error.

    Parameters
    ----------
    url
        ``sqlite:///FILE`` or ``postgresql+psycopg://...`` (``postgresql://`` is read as the same).
    asks_first
        Whether a connection to a server is asked, each time before it is used, if it is still there. Who repeats a
        transaction that failed for a lost connection needs no such question.
    outlives_power
        SQLite: whether a commit waits for the disk, so that it and all before it are still there after a power
        failure. Without, the last of them may be undone together; a process that is killed takes nothing along either
        way. With Postgres the server decides.
    """
    parsed = make_url(url)
    if parsed.get_backend_name() == "sqlite":
        if parsed.database:
            Path(parsed.database).parent.mkdir(parents=True, exist_ok=True)
        embedded = {"timeout": SQLITE_BUSY_TIMEOUT_S, "isolation_level": None, "check_same_thread": False}
        engine = create_engine(parsed, connect_args=embedded, **JSON_COLUMNS)
        event.listen(engine, "connect", partial(_configure_sqlite, "FULL" if outlives_power else "NORMAL"))
        event.listen(engine, "begin", _begin_immediate)
        return engine
    if parsed.drivername == "postgresql":
        parsed = parsed.set(drivername="postgresql+psycopg")
    unset = {name: value for name, value in POSTGRES_CONNECTION.items() if name not in parsed.query}
    engine = create_engine(parsed, pool_pre_ping=asks_first, connect_args=unset, **JSON_COLUMNS)
    event.listen(engine, "connect", _configure_postgres)
    return engine


def _configure_postgres(connection: Any, _record: Any) -> None:
    connection.execute(f"SET idle_in_transaction_session_timeout = '{IDLE_IN_TRANSACTION_S}s'")
    connection.commit()


def _configure_sqlite(synchronous: str, connection: Any, _record: Any) -> None:
    for pragma in ("journal_mode=WAL", f"synchronous={synchronous}", "foreign_keys=ON"):
        connection.execute(f"PRAGMA {pragma}")


def _begin_immediate(connection: Any) -> None:
    # A deferred transaction that turns into a writer fails at once when another writes; an immediate one waits.
    # Readers take no lock at all: in WAL mode they see the last commit.
    reading = connection.get_execution_options().get("read_only", False)
    connection.exec_driver_sql("BEGIN" if reading else "BEGIN IMMEDIATE")


@contextmanager
def at_once(engine: Engine) -> Iterator[Connection]:
    """A connection for what is one statement on Postgres, committed as it ends: two ways to the server are saved.

    SQLite, which may need several for the same, has them in one transaction.
    """
    if engine.dialect.name == "postgresql":
        with _each_statement_alone(engine).connect() as connection:
            yield connection
    else:
        with engine.begin() as connection:
            yield connection


@contextmanager
def transaction(engine: Engine) -> Iterator[Session]:
    """A session in one transaction: committed at the end, rolled back on an exception."""
    with Session(engine, expire_on_commit=False) as session, session.begin():
        yield session


@lru_cache(maxsize=4)  # making one takes longer than asking for a row
def _each_statement_alone(engine: Engine) -> Engine:
    """Postgres: the same connections, on which each statement is a transaction of its own."""
    return engine.execution_options(isolation_level="AUTOCOMMIT")


@lru_cache(maxsize=4)
def _only_reading(engine: Engine) -> Engine:
    """SQLite: the same connections, for transactions that take no lock."""
    return engine.execution_options(read_only=True)


@contextmanager
def reading(engine: Engine) -> Iterator[Session]:
    """A session that only reads, and never makes a writer wait.

    On SQLite from one snapshot. Postgres shows each statement what was committed before it, within a transaction as
    without one; without, the two ways to the server that begin and end it are saved.
    """
    reads = _each_statement_alone if engine.dialect.name == "postgresql" else _only_reading
    with Session(reads(engine), expire_on_commit=False) as session:
        yield session
