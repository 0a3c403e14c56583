"""The relay: publishes what the outbox holds, and sweeps for jobs whose worker fell silent.

Any number may run; one is enough.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import structlog
from kombu.exceptions import OperationalError
from sqlalchemy import Engine
from sqlalchemy.exc import SQLAlchemyError

from services.jobs.outbox import recall, relay, unclaimed
from services.jobs.retention import forget_old
from services.jobs.sweep import sweep
from services.jobs.tally import tally
from shared.db.engine import make_engine
from shared.db.revision import require_head
from shared.dispatch.broker import celery_app, queue_size, send
from shared.observability import configure_logging
from shared.settings import Settings
from worker.tasks import RUN_JOB

log = structlog.get_logger()


def run_relay(settings: Settings, stop: threading.Event) -> None:
    """Relay and sweep until `stop` is set. An outage of the database or the broker is waited out.

    The sweep has a thread of its own: a broker that does not answer holds up a message for seconds, and must not hold
    up the recovery of lost jobs.
    """
    engine = make_engine(settings.database_url, asks_first=False)  # `_repeat` is patient
    app = celery_app(settings.broker_url)

    backlog = partial(queue_size, app)
    lost_queue = LostQueue(engine, backlog, settings.sweep_s)

    def wake(job_ids: Sequence[str]) -> None:
        send(app, RUN_JOB, *job_ids)
        log.debug("messages sent", jobs=job_ids)

    def send_due() -> None:
        lost_queue.look()
        if sent := relay(engine, wake, settings.resend_after_s, backlog):
            log.info("messages sent", jobs=sent)
        stop.wait(settings.relay_poll_s)

    def tidy() -> None:
        sweep(engine, settings.max_attempts)
        tally(engine)
        if forgotten := forget_old(engine, settings.retention_days):
            log.info("old applications deleted", applications=forgotten)
        stop.wait(settings.sweep_s)

    sweeper = threading.Thread(target=_repeat, args=(tidy, stop, "sweep"), name="sweep")
    sweeper.start()
    _repeat(send_due, stop, "relay")
    sweeper.join()
    engine.dispose()


@dataclass
class LostQueue:
    """Looks now and then whether the broker has lost its queue, and has it sent again.

    An empty broker while jobs wait may be one whose last messages are on their way to a claim, so it has to be found
    empty twice in a row.
    """

    engine: Engine
    backlog: Callable[[], int]
    every_s: float
    _next: float = 0.0
    _was_empty: bool = False

    def look(self) -> None:
        """Every `every_s`; else nothing."""
        if time.monotonic() < self._next:
            return
        self._next = time.monotonic() + self.every_s
        empty = unclaimed(self.engine) > 0 and self.backlog() == 0
        if empty and self._was_empty:
            log.warning("the broker has lost its queue", jobs=recall(self.engine))
        self._was_empty = empty and not self._was_empty


def _repeat(act: Callable[[], None], stop: threading.Event, what: str) -> None:
    while not stop.is_set():
        try:
            act()
        except (SQLAlchemyError, OSError, OperationalError) as error:
            log.warning(f"{what} interrupted", error=str(error))
            stop.wait(1.0)
        except Exception:  # whatever one job or message is about, all others need this thread
            log.exception(f"{what} interrupted")
            stop.wait(1.0)


def main() -> None:
    """Process entry: ends on SIGTERM and SIGINT."""
    settings = Settings()
    configure_logging()
    require_head(settings.database_url)
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    run_relay(settings, stop)


if __name__ == "__main__":
    main()
