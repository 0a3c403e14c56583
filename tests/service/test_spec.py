"""What applications mean, kept by a process that was asked before."""

from __future__ import annotations

import pytest
from sqlalchemy import Engine

from services.jobs import views
from services.jobs.cancel import delete_application
from services.jobs.resolve import resolve
from services.jobs.spec import Kept, spec_of
from services.jobs.submit import submit
from shared.db.engine import reading
from shared.settings import Settings
from tests.service.requests import application


def test_those_asked_for_last_are_kept_with_so_many_tasks_together() -> None:
    kept, of_three_tasks = Kept(most_tasks=7), resolve(application(), lambda _: None, 10)
    kept.put("a", of_three_tasks)
    kept.put("b", of_three_tasks)
    assert kept.get("a") is of_three_tasks
    kept.put("c", of_three_tasks)
    assert [kept.get(name) is not None for name in "abc"] == [True, False, True]


def test_one_that_is_larger_than_what_is_kept_is_kept_alone() -> None:
    kept, of_three_tasks = Kept(most_tasks=2), resolve(application(), lambda _: None, 10)
    for name in "ab":
        kept.put(name, of_three_tasks)
    assert [kept.get(name) is not None for name in "ab"] == [False, True]


def test_what_was_deleted_is_gone_though_it_was_kept(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    with reading(engine) as session:
        kept = spec_of(session, application_id)
        assert kept is not None
        assert spec_of(session, application_id) is kept
    delete_application(engine, application_id)
    with pytest.raises(views.NotFoundError):
        views.status(engine, application_id)
