"""States of applications and jobs, and which transitions there are."""

from __future__ import annotations

import secrets
import time
from enum import StrEnum


class ApplicationState(StrEnum):
    """Where an application is. Everything but `QUEUED` and `RUNNING` is final."""

    QUEUED = "queued"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    COMPLETED_WITH_FAILURES = "completed_with_failures"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @property
    def final(self) -> bool:
        """Whether the application will never change again by itself."""
        return self not in (ApplicationState.QUEUED, ApplicationState.RUNNING)


class JobState(StrEnum):
    """Where a job is. `FAILED` is an answer (infeasible, or an exception), `DEAD` a worker lost three times."""

    QUEUED = "queued"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    DEAD = "dead"
    CANCELLED = "cancelled"

    @property
    def final(self) -> bool:
        """Whether the job has left the queue for good."""
        return self not in (JobState.QUEUED, JobState.RUNNING)


class Stage(StrEnum):
    """The stages that applications are made of, in the order in which they run."""

    CODESIGN = "codesign"
    RECONCILE = "reconcile"
    MOTIONS = "motions"
    SHARED_OPTIMUM = "shared_optimum"
    SHARED_MOTIONS = "shared_motions"


TRANSITIONS: dict[JobState, frozenset[JobState]] = {
    JobState.QUEUED: frozenset({JobState.RUNNING, JobState.CANCELLED, JobState.DEAD}),
    JobState.RUNNING: frozenset(
        {JobState.QUEUED, JobState.SUCCEEDED, JobState.FAILED, JobState.DEAD, JobState.CANCELLED}
    ),
}
"""Where a job may go from a state; final states lead nowhere (a retry is a new job of the next generation)."""

NO_TASK = -1
"""Task index of a job that belongs to no single task, such as reconcile."""

NO_METHOD = ""
"""Method of a job that serves all methods."""


def new_id() -> str:
    """A new identifier of 22 hexadecimal digits that sorts by time of creation (to the millisecond)."""
    return f"{time.time_ns() // 1_000_000:012x}{secrets.token_hex(5)}"
