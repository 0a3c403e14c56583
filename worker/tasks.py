"""The one Celery task. Its body is three lines; the work is in `worker.run_job`."""

from __future__ import annotations

import os
from functools import lru_cache

from celery import shared_task
from sqlalchemy import Engine

from shared.db.engine import make_engine
from shared.settings import Settings
from worker.run_job import wake_up

RUN_JOB = "armature.run_job"
"""Name by which the relay sends."""

MODULE = __name__
"""Where pool processes find the task when they are spawned, not forked."""


@shared_task(name=RUN_JOB)  # type: ignore[untyped-decorator]
def run_job_task(job_id: str) -> None:
    """Claim a job, solve it, record the outcome."""
    engine, settings = _process()
    wake_up(engine, settings, job_id)


@lru_cache(maxsize=1)
def _process() -> tuple[Engine, Settings]:
    """Settings from the environment, and one engine a process, made after the fork, as what else a process is told.

    Its heartbeat gives way with it: a quarter of a processor is left to it beside whoever is busy, and a lease waits
    for four beats. The worker's parent, which hands out messages, gives way to nobody.
    """
    settings = Settings()
    os.nice(settings.solver_niceness)
    return make_engine(settings.database_url, asks_first=False), settings  # `run_job` is patient
