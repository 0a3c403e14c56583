"""An exception on the way of a job is its outcome: failed at once, with the reason. An outage is none."""

from __future__ import annotations

import sqlite3
from typing import Any

import numpy as np
import pytest
from sqlalchemy import Engine, select, update
from sqlalchemy.exc import OperationalError

import services.jobs.store
import worker.patience
import worker.run_job
from services.jobs.claim import claim
from services.jobs.finish import Outcome
from services.jobs.submit import submit
from services.jobs.sweep import sweep
from shared.db.engine import transaction
from shared.db.tables import Job
from shared.domain import JobState
from shared.settings import Settings
from tests.service.queue_actions import (
    EXPIRED_LEASE_S,
    assert_history_is_sound,
    drain,
    queued,
    rows,
    state_of,
)  # fmt: skip
from tests.service.requests import application
from worker.run_job import run_job


def jobs(engine: Engine) -> list[Any]:
    """All of them, in order."""
    return rows(engine, select(Job.state, Job.attempts, Job.reason).order_by(Job.id))


def raising(error: Exception) -> Any:
    """In place of a function."""

    def act(*_: Any, **__: Any) -> Any:
        raise error

    return act


@pytest.mark.parametrize("step", ["execute", "load_work"])
def test_what_a_job_raises_is_its_reason(
    engine: Engine, settings: Settings, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    application_id, _ = submit(engine, settings, application())
    first, *_ = queued(engine)
    with monkeypatch.context() as patch:
        patch.setattr(worker.run_job, step, raising(ValueError("no number: \ud800\0" + "x" * 5000)))
        run_job(engine, settings, first)
    state, attempts, reason = jobs(engine)[0]
    assert (state, attempts) == (JobState.FAILED, 1)
    assert reason.startswith("solving raised ValueError: no number: \\ud800\\0xx")
    assert len(reason) == 1000
    run_job(engine, settings, first)  # its message comes again
    drain(engine)
    assert state_of(engine, application_id) == ("completed_with_failures", "1 solve failed")
    assert_history_is_sound(engine, application_id)


def test_a_result_that_cannot_be_stored(engine: Engine, settings: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    application_id, _ = submit(engine, settings, application())
    strange = Outcome(JobState.SUCCEEDED, value=1.0, summary={"array": np.zeros(2)})
    with monkeypatch.context() as patch:
        patch.setattr(worker.run_job, "execute", lambda *_: strange)
        run_job(engine, settings, queued(engine)[0])
    state, attempts, reason = jobs(engine)[0]
    assert (state, attempts) == (JobState.FAILED, 1)
    assert "storing the result raised" in reason
    assert "Unable to serialize unknown type" in reason
    drain(engine)
    assert_history_is_sound(engine, application_id)


def test_an_outage_is_no_outcome(engine: Engine, settings: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    """The worker ends while the database is away: the job stays running, until its lease is over."""
    submit(engine, settings, application())
    away = sqlite3.OperationalError("database is locked")
    away.sqlite_errorcode = sqlite3.SQLITE_BUSY
    monkeypatch.setattr(worker.run_job, "load_work", raising(OperationalError("SELECT", {}, away)))
    drained = iter([False, True])
    monkeypatch.setattr(worker.patience.patiently, "__defaults__", (lambda: next(drained),))
    with pytest.raises(OperationalError):
        run_job(engine, settings, queued(engine)[0])
    assert [state for state, *_ in jobs(engine)] == [JobState.RUNNING, JobState.QUEUED, JobState.QUEUED]


def test_planning_that_raises_ends_the_application(
    engine: Engine, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    application_id, _ = submit(engine, settings, application())
    monkeypatch.setattr(services.jobs.store, "plan_next", raising(KeyError("no such stage")))
    drain(engine)
    expected = "what follows codesign cannot be planned: KeyError: 'no such stage'"
    assert state_of(engine, application_id) == ("failed", expected)
    assert_history_is_sound(engine, application_id)


def test_one_job_that_cannot_be_recovered_holds_up_no_other(engine: Engine, settings: Settings) -> None:
    """A state that no version of this program wrote, in the first of two lost jobs."""
    broken, sound = (submit(engine, settings, application())[0] for _ in range(2))
    for application_id in (broken, sound):
        first = rows(engine, select(Job.id).where(Job.application_id == application_id).order_by(Job.id))[0]
        assert claim(engine, first.id, "worker", EXPIRED_LEASE_S)
    with transaction(engine) as session:
        lost = Job.state == JobState.RUNNING
        session.execute(update(Job).where(lost, Job.application_id == broken).values(stage="polishing", attempts=3))
    assert sweep(engine, max_attempts=3) == 1
    of_sound = select(Job.state).where(Job.application_id == sound)
    assert {row.state for row in rows(engine, of_sound)} == {JobState.QUEUED}
