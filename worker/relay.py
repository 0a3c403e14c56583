"""The relay: publishes what the outbox holds, and sweeps for jobs whose worker fell silent.

Any number may run; one is enough.
"""

from __future__ import annotations

import signal
import threading
import time

import structlog
from kombu.exceptions import OperationalError
from sqlalchemy.exc import SQLAlchemyError

from services.jobs.outbox import relay
from services.jobs.sweep import sweep
from services.jobs.tally import tally
from shared.db.engine import make_engine
from shared.dispatch.broker import celery_app, send
from shared.observability import configure_logging
from shared.settings import Settings
from worker.tasks import RUN_JOB

log = structlog.get_logger()


def run_relay(settings: Settings, stop: threading.Event) -> None:
    """Relay and sweep until `stop` is set. An outage of the database or the broker is waited out."""
    engine, app = make_engine(settings.database_url), celery_app(settings.broker_url)
    next_sweep = 0.0
    while not stop.is_set():
        try:
            sent = relay(engine, lambda job_id: send(app, RUN_JOB, job_id), settings.resend_after_s)
            if time.monotonic() >= next_sweep:
                next_sweep = time.monotonic() + settings.sweep_s
                tally(engine)
                if recovered := sweep(engine, settings.max_attempts):
                    log.warning("leases expired", jobs=recovered)
            if not sent:
                stop.wait(settings.relay_poll_s)
        except (SQLAlchemyError, OSError, OperationalError) as error:
            log.warning("relay interrupted", error=str(error))
            stop.wait(1.0)
    engine.dispose()


def main() -> None:
    """Process entry: ends on SIGTERM and SIGINT."""
    settings = Settings()
    configure_logging()
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    run_relay(settings, stop)


if __name__ == "__main__":
    main()
