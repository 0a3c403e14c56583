"""Retry over SQLite and Postgres: only what failed is done again."""

from __future__ import annotations

from collections import Counter

import pytest
from sqlalchemy import Engine, select

from services.jobs import results, views
from services.jobs.cancel import cancel
from services.jobs.claim import claim
from services.jobs.finish import finish
from services.jobs.retry import NotRetryableError, retry
from services.jobs.submit import submit
from shared.db.tables import Job
from shared.domain import ApplicationState
from shared.domain import Stage as StageName
from shared.settings import Settings
from tests.service.queue_actions import (
    DESIGN,
    LONG_LEASE_S,
    drain,
    outcome_of,
    queued,
    rows,
    state_of,
    take,
)
from tests.service.requests import application


def specs(engine: Engine, application_id: str) -> Counter[tuple[int, str, int, str]]:
    """(generation, stage, task, state) of all jobs."""
    statement = select(Job.generation, Job.stage, Job.task_index, Job.state).where(Job.application_id == application_id)
    return Counter(tuple(row) for row in rows(engine, statement))


def test_retry_does_again_only_what_failed_and_what_depends_on_it(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    drain(engine, failing=frozenset({1}))
    assert retry(engine, application_id)
    assert state_of(engine, application_id) == (ApplicationState.QUEUED, None)
    assert len(queued(engine)) == 1
    drain(engine)
    assert state_of(engine, application_id)[0] == ApplicationState.SUCCEEDED
    found = specs(engine, application_id)
    assert found[(0, "codesign", 1, "failed")] == 1
    assert found[(0, "reconcile", -1, "succeeded")] == 1  # the mean of two tasks: history
    assert all(found[(1, "codesign", task, "succeeded")] == 1 for task in range(3))
    assert found[(1, "reconcile", -1, "succeeded")] == 1
    assert all(found[(1, "motions", task, "succeeded")] == 1 for task in range(3))
    assert [task.state for task in views.tasks(engine, application_id, 0, 10).items] == ["succeeded"] * 3
    status = views.status(engine, application_id)
    assert [(s.name, s.total, s.succeeded) for s in status.progress.stages] == [
        ("codesign", 3, 3),
        ("reconcile", 1, 1),
        ("motions", 3, 3),
    ]


def test_retry_of_a_failed_motion_keeps_the_design(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    while jobs := queued(engine):
        for job_id in jobs:
            held = claim(engine, job_id, "worker", LONG_LEASE_S)
            assert held is not None
            motion = held.spec.stage == StageName.MOTIONS
            assert finish(engine, held, outcome_of(held, frozenset({2} if motion else ())))
    assert state_of(engine, application_id)[0] == ApplicationState.COMPLETED_WITH_FAILURES
    assert retry(engine, application_id)
    assert len(queued(engine)) == 1
    assert results.design(engine, application_id).design_mm == DESIGN["design_mm"]
    drain(engine)
    assert state_of(engine, application_id)[0] == ApplicationState.SUCCEEDED


def test_retry_after_a_cancel_goes_on_where_it_was(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    held = take(engine)
    assert finish(engine, held, outcome_of(held))
    cancel(engine, application_id)
    assert state_of(engine, application_id)[0] == ApplicationState.CANCELLED
    assert retry(engine, application_id)
    assert len(queued(engine)) == 2
    drain(engine)
    assert state_of(engine, application_id)[0] == ApplicationState.SUCCEEDED


def test_retry_is_refused_while_running_and_when_all_is_well(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    with pytest.raises(NotRetryableError, match="queued"):
        retry(engine, application_id)
    drain(engine)
    with pytest.raises(NotRetryableError, match="nothing to do again"):
        retry(engine, application_id)
    assert not retry(engine, "nothing")
