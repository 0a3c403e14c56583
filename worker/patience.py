"""Waiting out an outage of the database: neither a message nor a finished solve is thrown away because of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

import structlog
from sqlalchemy.exc import InterfaceError, OperationalError

from worker.drain import drained

log = structlog.get_logger()

FIRST_WAIT_S = 0.1
LONGEST_WAIT_S = 2.0

T = TypeVar("T")


def patiently(action: Callable[[], T]) -> T:
    """Repeat a transaction until the database answers, or until this worker has to end.

    A commit whose answer was lost may have happened. The repeated transaction then finds the job in another state and
    changes nothing: a claim is a conditional update, and a finish needs a running job and its fencing token.

    Raises
    ------
    OperationalError, InterfaceError
        The database is away, and the worker's grace is over.
    """
    wait = FIRST_WAIT_S
    while True:
        try:
            return action()
        except (OperationalError, InterfaceError) as error:
            if drained():
                raise
            log.warning("waiting for the database", error=str(error))
        time.sleep(wait)
        wait = min(2 * wait, LONGEST_WAIT_S)
