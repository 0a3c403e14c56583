"""A real worker with tasks that only write down that they ran.

Run as `python -m tests.contract.noop_worker URL QUEUE FILE START_METHOD`.
"""

# mypy: allow-untyped-decorators

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

from celery import shared_task

from shared.dispatch.broker import celery_app, worker_arguments

NOTE, NAP, DIE = "test.note", "test.nap", "test.die"
RECORD = "ARMATURE_TEST_RECORD"


@shared_task(name=NOTE)
def note(job_id: str) -> None:
    """Write an id and the process down."""
    with Path(os.environ[RECORD]).open("a") as file:  # one short append: whole lines, whoever else writes
        file.write(f"{job_id} {os.getpid()}\n")


@shared_task(name=NAP)
def nap(job_id: str) -> None:
    """Take a while."""
    note(f"{job_id}-begins")
    time.sleep(1.5)
    note(f"{job_id}-ends")


@shared_task(name=DIE)
def die(job_id: str) -> None:
    """End the process that runs it."""
    note(job_id)
    os.kill(os.getpid(), signal.SIGKILL)


def main(broker_url: str, queue: str, record: str, start_method: str) -> None:
    """Start the worker."""
    os.environ[RECORD] = record
    app = celery_app(broker_url, queue=queue, task_modules=["tests.contract.noop_worker"])
    app.conf.worker_pool_start_method = start_method
    app.worker_main(worker_arguments(2))


if __name__ == "__main__":
    main(*sys.argv[1:])
