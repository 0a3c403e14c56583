"""A real worker with tasks that only write down that they ran.

Run as `python -m tests.contract.noop_worker URL QUEUE FILE`.
"""

# mypy: allow-untyped-decorators

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

from shared.dispatch.broker import celery_app, worker_arguments

NOTE, NAP, DIE = "test.note", "test.nap", "test.die"


def main(broker_url: str, queue: str, record: str) -> None:
    app = celery_app(broker_url, queue=queue)

    def note(job_id: str) -> None:
        with Path(record).open("a") as file:  # one short append: whole lines, whoever else writes
            file.write(f"{job_id} {os.getpid()}\n")

    @app.task(name=NOTE)
    def _note(job_id: str) -> None:
        note(job_id)

    @app.task(name=NAP)
    def _nap(job_id: str) -> None:
        note(f"{job_id}-begins")
        time.sleep(1.5)
        note(f"{job_id}-ends")

    @app.task(name=DIE)
    def _die(job_id: str) -> None:
        note(job_id)
        os.kill(os.getpid(), signal.SIGKILL)

    app.worker_main(worker_arguments(2))


if __name__ == "__main__":
    main(*sys.argv[1:])
