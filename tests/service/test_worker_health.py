"""The worker's health check: silent, stuck, or well."""

from __future__ import annotations

import pytest
from sqlalchemy import Engine, text

from services.jobs.claim import claim
from services.jobs.submit import submit
from services.jobs.workers import sign_of_life
from shared.db.engine import transaction
from shared.settings import Settings
from tests.service.queue_actions import LONG_LEASE_S, queued
from tests.service.requests import application
from worker import sign_of_life as health


def test_a_silent_worker(engine: Engine, settings: Settings) -> None:
    assert "no worker of here" in str(health.complaint(settings, "here"))
    sign_of_life(engine, "elsewhere:1", "elsewhere", 2)
    assert health.complaint(settings, "here") is not None
    sign_of_life(engine, "here:1", "here", 2)
    assert health.complaint(settings, "here") is None
    with transaction(engine) as session:
        session.execute(text("UPDATE workers SET seen_at = seen_at - 46"))
    assert health.complaint(settings, "here") is not None


def test_a_worker_that_takes_nothing(engine: Engine, settings: Settings) -> None:
    submit(engine, settings, application())
    sign_of_life(engine, "here:1", "here", 2)
    assert health.complaint(settings, "here") is None
    with transaction(engine) as session:
        session.execute(text("UPDATE jobs SET created_at = created_at - 901"))
    assert "holds none" in str(health.complaint(settings, "here"))
    assert claim(engine, queued(engine)[0], "here:2", LONG_LEASE_S) is not None  # a process of its pool
    assert health.complaint(settings, "here") is None


def test_without_a_database_nothing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ARMATURE_DATABASE_URL", "postgresql://nobody@127.0.0.1:1/nothing")
    assert health.main() == 0
