"""Events of an application over SQLite and Postgres: numbered, complete, bounded."""

from __future__ import annotations

from collections import Counter

import pytest
from sqlalchemy import Engine

from services.codesign.solver import IterationReport
from services.jobs.claim import report
from services.jobs.events import events_after
from services.jobs.finish import finish
from services.jobs.submit import submit
from shared.settings import Settings
from tests.service.queue_actions import (
    drain,
    outcome_of,
    take,
)
from tests.service.requests import application


def test_events_tell_the_whole_story_without_gap_or_double(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    held = take(engine)
    report(engine, held, IterationReport(attempt=0, iteration=7, objective=0.5))
    half = events_after(engine, application_id, 0)
    assert not half.ended
    assert half.items[-1].content["iteration"] == 7
    failing = frozenset({2})
    assert finish(engine, held, outcome_of(held, failing))
    drain(engine, failing)
    rest = events_after(engine, application_id, half.items[-1].number)
    assert rest.ended
    story = [*half.items, *rest.items]
    assert [event.number for event in story] == list(range(1, len(story) + 1))
    assert [event.content["stage"] for event in story if event.kind == "stage"] == ["codesign", "reconcile", "motions"]
    ends = Counter(event.content["to"] for event in story if event.kind == "job")
    assert ends == {"running": 6, "succeeded": 5, "failed": 1}
    assert [e.content["state"] for e in story if e.kind == "application"] == ["running", "completed_with_failures"]


def test_old_events_are_pruned_and_it_is_said(
    engine: Engine, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("services.jobs.record.MOST_EVENTS", 4)
    monkeypatch.setattr("services.jobs.record.PRUNE_EVERY", 2)
    application_id, _ = submit(engine, settings, application())
    drain(engine)
    found = events_after(engine, application_id, 0)
    assert found.pruned
    assert found.ended
    assert len(found.items) <= 6
    assert not events_after(engine, application_id, found.items[0].number).pruned
