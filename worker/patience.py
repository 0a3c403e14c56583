"""Waiting out an outage of the database: neither a message nor a finished solve is thrown away because of it."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Callable
from typing import TypeVar

import structlog
from sqlalchemy.exc import DBAPIError, OperationalError

from worker.drain import drained

log = structlog.get_logger()

FIRST_WAIT_S = 0.1
LONGEST_WAIT_S = 2.0

SQLITE_PASSES = {
    sqlite3.SQLITE_BUSY,
    sqlite3.SQLITE_LOCKED,
    sqlite3.SQLITE_IOERR,
    sqlite3.SQLITE_FULL,
    sqlite3.SQLITE_CANTOPEN,
}
POSTGRES_PASSES = ("08", "25P03", "40", "53", "55", "57", "58")
"""Beginnings of SQLSTATE: connection, idle transaction ended, serialization, resources, locks, operator, system."""
DISK_FULL = {sqlite3.SQLITE_FULL, "53100"}

T = TypeVar("T")


def patiently(action: Callable[[], T], give_up: Callable[[], bool] = drained) -> T:
    """Repeat a transaction until the database answers, or until it is time to give up.

    A commit whose answer was lost may have happened. The repeated transaction then finds the job in another state and
    changes nothing: a claim is a conditional update, and a finish needs a running job and its fencing token.

    Raises
    ------
    DBAPIError
        Waiting does not help (a table is missing, a right), or it is time to give up: by default when the worker's
        grace is over.
    """
    wait = FIRST_WAIT_S
    while True:
        try:
            return action()
        except DBAPIError as error:
            if give_up() or not passes(error):
                raise
            full = _code(error) in DISK_FULL
            log.warning("the database's disk is full" if full else "waiting for the database", error=str(error.orig))
        time.sleep(wait)
        wait = min(2 * wait, LONGEST_WAIT_S)


def for_the_next(seconds: float) -> Callable[[], bool]:
    """For `give_up`: after so long."""
    end = time.monotonic() + seconds
    return lambda: time.monotonic() >= end


def passes(error: DBAPIError) -> bool:
    """Whether an error is one of those that end by themselves, or by an operator's hand."""
    code = _code(error)
    if isinstance(code, int):
        return code in SQLITE_PASSES
    return error.connection_invalidated or (code is not None and code.startswith(POSTGRES_PASSES))


def _code(error: DBAPIError) -> int | str | None:
    """SQLite's primary result code, or Postgres' SQLSTATE; a lost connection has the one of its class."""
    if isinstance(error.orig, sqlite3.Error):
        return getattr(error.orig, "sqlite_errorcode", sqlite3.SQLITE_ERROR) & 0xFF
    code: str | None = getattr(error.orig, "sqlstate", None)
    return "08000" if code is None and isinstance(error, OperationalError) else code
