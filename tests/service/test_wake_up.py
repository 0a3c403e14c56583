"""A message wakes a process up, which goes on with jobs whose messages are not sent, as long as it is soon done."""

from __future__ import annotations

from typing import Any

import psycopg
import pytest
from sqlalchemy import Engine
from sqlalchemy.exc import OperationalError

import services.jobs.claim
import worker.run_job
from services.jobs.finish import Outcome
from services.jobs.submit import submit
from shared.domain import ApplicationState
from shared.settings import Settings
from tests.service.queue_actions import assert_history_is_sound, outcome_of, queued, state_of
from tests.service.requests import application
from worker.run_job import wake_up

LONG_S = 600.0


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    """No solves, and no job passed over."""
    monkeypatch.setattr(worker.run_job, "execute", lambda work, *_: outcome_of(work))
    monkeypatch.setattr(services.jobs.claim, "SPREAD", 1)
    monkeypatch.setattr(worker.run_job, "GO_ON_S", LONG_S)


def test_one_message_is_enough(engine: Engine, settings: Settings) -> None:
    """Through all stages: nobody relays here."""
    application_id, _ = submit(engine, settings, application())
    wake_up(engine, settings, queued(engine)[0])
    assert state_of(engine, application_id)[0] == ApplicationState.SUCCEEDED
    assert_history_is_sound(engine, application_id)


def test_a_message_that_comes_late_wakes_nobody_up(engine: Engine, settings: Settings) -> None:
    """Behind it in the broker may be older jobs than those that were not sent."""
    submit(engine, settings, application())
    jobs = queued(engine)
    wake_up(engine, settings, "a job that is gone")
    assert queued(engine) == jobs


def test_an_outage_ends_the_search_for_more(
    engine: Engine, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The job of the message is done; a claim whose answer was lost is not made again of another job."""

    def away(*_: Any) -> None:
        raise OperationalError("claim", None, psycopg.OperationalError("gone"))

    monkeypatch.setattr(worker.run_job, "claim_unsent", away)
    submit(engine, settings, application())
    first, *others = queued(engine)
    wake_up(engine, settings, first)
    assert queued(engine) == others


def test_who_was_busy_for_long_asks_for_the_next_message(
    engine: Engine, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker.run_job, "GO_ON_S", 0.0)
    submit(engine, settings, application())
    first, *others = queued(engine)
    wake_up(engine, settings, first)
    assert queued(engine) == others


def test_a_worker_that_shuts_down_begins_nothing(
    engine: Engine, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The job at hand is finished."""
    told: list[bool] = []

    def solve(work: Any, *_: Any) -> Outcome:
        told.append(True)
        return outcome_of(work)

    monkeypatch.setattr(worker.run_job, "execute", solve)
    monkeypatch.setattr(worker.run_job, "draining", lambda: bool(told))
    submit(engine, settings, application())
    first, *others = queued(engine)
    wake_up(engine, settings, first)
    assert queued(engine) == others
