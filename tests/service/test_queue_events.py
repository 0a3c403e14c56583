"""Events of an application over SQLite and Postgres: numbered, complete, bounded."""

from __future__ import annotations

from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import pytest
from sqlalchemy import Engine, select

from services.codesign.solver import IterationReport
from services.jobs.claim import claim, report
from services.jobs.events import events_after
from services.jobs.finish import finish
from services.jobs.submit import submit
from shared.db.engine import reading
from shared.db.tables import Application, Event, Stage
from shared.settings import Settings
from tests.service.queue_actions import (
    LONG_LEASE_S,
    assert_history_is_sound,
    drain,
    outcome_of,
    queued,
    take,
)
from tests.service.requests import HOME, POSE, application


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


def test_events_of_jobs_that_begin_and_end_together_are_numbered_in_a_row(engine: Engine, settings: Settings) -> None:
    """Each move of a job waits for those of its application's others, and then counts on from what they left."""
    tasks = [{"start_rad": POSE, "end_rad": HOME, "payload_kg": 0.01 * k} for k in range(40)]
    application_id, _ = submit(engine, settings, application(tasks=tasks))

    def work(job_id: str) -> None:
        held = claim(engine, job_id, "worker", LONG_LEASE_S)
        assert held is not None
        assert finish(engine, held, outcome_of(held))

    with ThreadPoolExecutor(6) as workers:
        list(workers.map(work, queued(engine)))
    (reconcile,) = queued(engine)
    with reading(engine) as session:
        last_event = session.get_one(Application, application_id).last_event
        stage = session.get_one(Stage, (application_id, 0, "codesign"))
        numbers = list(session.scalars(select(Event.number).order_by(Event.number)))
    assert (stage.total, stage.remaining) == (40, 0)
    assert numbers == list(range(1, last_event + 1))
    # A stage, the first claim's "running", two moves of each job, and the next stage.
    assert last_event == 1 + 1 + 2 * 40 + 1
    work(reconcile)
    drain(engine)
    assert_history_is_sound(engine, application_id)
