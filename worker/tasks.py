"""The one Celery task. Its body is three lines; the work is in `run_job`."""

from __future__ import annotations

from functools import lru_cache

from celery import Celery
from sqlalchemy import Engine

from shared.db.engine import make_engine
from shared.settings import Settings
from worker.run_job import run_job

RUN_JOB = "armature.run_job"
"""Name by which the relay sends."""


def register_tasks(app: Celery, settings: Settings) -> None:
    """Add the task to an application."""

    @app.task(name=RUN_JOB)  # type: ignore[untyped-decorator]
    def _run_job(job_id: str) -> None:
        run_job(_engine(settings.database_url), settings, job_id)


@lru_cache(maxsize=4)
def _engine(database_url: str) -> Engine:
    """One engine a process, made after the fork."""
    return make_engine(database_url)
