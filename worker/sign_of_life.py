"""The worker's parent process says in the database that it lives, and a health check reads what it said."""

from __future__ import annotations

import os
import socket
import sys
import threading

import structlog
from sqlalchemy.exc import SQLAlchemyError

from services.jobs.queue import queue_depth
from services.jobs.workers import list_workers, say_goodbye, sign_of_life
from shared.db.engine import make_engine
from shared.settings import Settings

log = structlog.get_logger()


_connected = threading.Lock()
"""Held while the parent has a connection. A process forked meanwhile would inherit SQLite's note that this process has
the write lock, and find the database locked for ever: forks wait."""
os.register_at_fork(before=_connected.acquire, after_in_parent=_connected.release, after_in_child=_connected.release)


def worker_name() -> str:
    """Host and process, for people reading the history."""
    return f"{socket.gethostname()}:{os.getpid()}"


def keep_saying(settings: Settings, stop: threading.Event) -> None:
    """A sign of life every heartbeat until `stop`, then a goodbye. An outage of the database is waited out."""
    engine, name = make_engine(settings.database_url), worker_name()
    last = False
    while not last:
        last = stop.is_set()
        with _connected:
            try:
                if last:
                    say_goodbye(engine, name)
                else:
                    sign_of_life(engine, name, socket.gethostname(), settings.workers)
            except SQLAlchemyError as error:
                log.warning("sign of life failed", worker=name, error=str(error))
            engine.dispose()
        if not last:
            stop.wait(settings.heartbeat_s)


def complaint(settings: Settings, host: str) -> str | None:
    """What is wrong with the worker of a host; None: nothing.

    It has to give signs of life, and where jobs have long been waiting, to hold leases.
    """
    engine = make_engine(settings.database_url)
    try:
        here = [worker for worker in list_workers(engine) if worker.host == host]
        living = [worker for worker in here if worker.silent_s < settings.lease_s]
        if not living:
            return f"no worker of {host} gave a sign of life in the last {settings.lease_s:g} s"
        waited = queue_depth(engine).oldest_queued_age_s
        if waited > settings.stuck_s and not any(worker.running for worker in living):
            return f"a job has waited for {waited:.0f} s, and the worker of {host} holds none"
    finally:
        engine.dispose()
    return None


def main() -> int:
    """Process entry of the health check: exit code 1 when the worker of this host should be started anew.

    Without a database nothing can be said, and starting anew would not help: that is no complaint.
    """
    try:
        said = complaint(Settings(), socket.gethostname())
    except SQLAlchemyError as error:
        print(f"the database cannot be asked: {error}", file=sys.stderr)
        return 0
    if said is not None:
        print(said, file=sys.stderr)
    return 1 if said else 0


if __name__ == "__main__":
    sys.exit(main())
