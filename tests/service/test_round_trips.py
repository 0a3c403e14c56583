"""How often one job asks the database: claim, inputs and finish, statement by statement."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from sqlalchemy import Engine, event

from services.jobs.claim import claim, renew
from services.jobs.finish import finish
from services.jobs.submit import submit
from services.jobs.work import load_work
from shared.settings import Settings
from tests.service.queue_actions import LONG_LEASE_S, outcome_of, queued
from tests.service.requests import application


@contextmanager
def statements(engine: Engine) -> Iterator[list[str]]:
    """What is sent meanwhile, without the BEGIN and COMMIT around it."""
    sent: list[str] = []

    def note(_connection: object, _cursor: object, statement: str, *_: object) -> None:
        sent.append(statement)

    event.listen(engine, "before_cursor_execute", note)
    yield sent
    event.remove(engine, "before_cursor_execute", note)


@pytest.mark.parametrize("database_url", ["postgres"], indirect=True)
def test_what_a_job_asks_of_the_database(engine: Engine, settings: Settings) -> None:
    """A job in the middle of its stage: neither the first claim of its application nor the last finish.

    On Postgres: SQLite runs in the process, and is sent nothing.
    """
    submit(engine, settings, application())
    first, second, _ = queued(engine)
    held = claim(engine, first, "worker", LONG_LEASE_S)
    assert held is not None
    work = load_work(engine, held)
    assert work is not None
    with statements(engine) as of_claim:
        held = claim(engine, second, "worker", LONG_LEASE_S)
    assert held is not None
    with statements(engine) as of_load:
        assert load_work(engine, held) is not None
    with statements(engine) as of_renew:
        assert renew(engine, held, LONG_LEASE_S).mine
    with statements(engine) as of_finish:
        assert finish(engine, held, outcome_of(held))
    counted = {"claim": of_claim, "load": of_load, "renew": of_renew, "finish": of_finish}
    assert {what: len(sent) for what, sent in counted.items()} == {"claim": 1, "load": 0, "renew": 1, "finish": 1}
