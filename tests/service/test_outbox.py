"""The outbox over SQLite and Postgres: what is sent, when it is sent again, and what is taken without a message."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Sequence

import pytest
from sqlalchemy import Engine, select, text, update

import services.jobs.claim
from services.jobs import outbox
from services.jobs.claim import claim, claim_unsent
from services.jobs.finish import finish
from services.jobs.outbox import recall, relay
from services.jobs.submit import submit
from shared.db.engine import transaction
from shared.db.tables import Outbox
from shared.domain import ApplicationState
from shared.settings import Settings
from tests.service.queue_actions import (
    LONG_LEASE_S,
    assert_history_is_sound,
    outcome_of,
    queued,
    rows,
    state_of,
    take,
)
from tests.service.requests import application

WAITING_FOR_A_LOCK = text(
    "SELECT pid FROM pg_stat_activity WHERE wait_event_type = 'Lock' AND datname = current_database()"
)


def test_the_relay_sends_each_job_and_again_when_nobody_claims(engine: Engine, settings: Settings) -> None:
    submit(engine, settings, application())
    sent: list[str] = []
    assert relay(engine, sent.extend, resend_after_s=30.0) == 3
    assert sorted(sent) == queued(engine)
    assert relay(engine, sent.extend, resend_after_s=30.0) == 0  # not yet
    with transaction(engine) as session:  # half a minute later
        session.execute(text("UPDATE outbox SET due_at = due_at - 31"))
    take(engine)
    assert relay(engine, sent.extend, resend_after_s=30.0) == 2
    assert [row.sent for row in rows(engine, select(Outbox.sent).where(Outbox.due_at.is_not(None)))] == [2, 2]


@pytest.mark.parametrize("database_url", ["postgres"], indirect=True)
def test_the_relay_waits_for_nobody_who_changes_messages(engine: Engine, settings: Settings) -> None:
    """It marks many at once; someone who has one of them and wants another must not wait for it while it waits."""
    submit(engine, settings, application())
    first, _, last = queued(engine)
    sent: list[str] = []
    relaying = threading.Thread(target=lambda: relay(engine, sent.extend, 30.0))
    with engine.begin() as other:
        silence = update(Outbox).values(due_at=None)
        other.execute(silence.where(Outbox.job_id == last))
        relaying.start()
        while relaying.is_alive() and not rows(engine, WAITING_FOR_A_LOCK):
            relaying.join(0.05)
        other.execute(silence.where(Outbox.job_id == first))
    relaying.join()
    assert sorted(sent) == queued(engine)
    assert [row.sent for row in rows(engine, select(Outbox.sent).order_by(Outbox.job_id))] == [1, 1, 0]
    assert relay(engine, sent.extend, 30.0) == 0


def test_a_crash_between_publish_and_mark_doubles_and_loses_nothing(
    engine: Engine, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    submit(engine, settings, application())
    sent: list[str] = []
    with monkeypatch.context() as crash:
        crash.setattr(outbox, "_put_off", lambda *_: (_ for _ in ()).throw(SystemExit))
        with pytest.raises(SystemExit):
            relay(engine, sent.extend, 30.0)
    assert relay(engine, sent.extend, 30.0) == 3
    assert Counter(sent) == dict.fromkeys(queued(engine), 2)


def test_nothing_is_sent_again_while_the_broker_holds_a_message_for_each_job(
    engine: Engine, settings: Settings
) -> None:
    submit(engine, settings, application())
    sent: list[str] = []

    def later(backlog: int) -> int:
        with transaction(engine) as session:
            session.execute(text("UPDATE outbox SET due_at = due_at - 10000"))
        return relay(engine, sent.extend, 30.0, lambda: backlog)

    assert later(0) == 3
    assert [later(3) for _ in range(50)] == [0] * 50  # a long wait in a long queue
    assert later(2) == 1  # one message was lost
    assert later(0) == 3  # all were
    take(engine)
    assert later(2) == 0


def test_a_broker_that_fails_is_sent_everything_again(engine: Engine, settings: Settings) -> None:
    submit(engine, settings, application())

    def fail(_: Sequence[str]) -> None:
        raise OSError("gone")

    with pytest.raises(OSError, match="gone"):
        relay(engine, fail, 30.0)
    assert relay(engine, lambda _: None, 30.0) == 3


def test_no_more_messages_are_out_than_keep_everybody_busy(
    engine: Engine, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(outbox, "AHEAD", 2)
    submit(engine, settings, application())
    sent: list[str] = []
    held = [0, 2, 1]  # by the broker: the first, then two are out, then one was taken
    assert [relay(engine, sent.extend, 30.0, lambda: number) for number in held] == [2, 0, 1]  # noqa: B023
    assert sent == [row.job_id for row in rows(engine, select(Outbox.job_id).order_by(Outbox.job_id))]


def test_messages_that_the_broker_lost_come_before_those_never_sent(
    engine: Engine, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(outbox, "AHEAD", 2)
    submit(engine, settings, application())
    first: list[str] = []
    relay(engine, first.extend, 30.0)
    assert recall(engine) == 2
    due = rows(engine, select(Outbox.job_id).order_by(Outbox.due_at))
    assert {row.job_id for row in due[:2]} == set(first)
    sent: list[str] = []
    relay(engine, sent.extend, 30.0)
    assert set(first) <= set(sent)


def test_a_process_at_hand_takes_what_was_not_sent(
    engine: Engine, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And its message is not sent any more."""
    monkeypatch.setattr(outbox, "AHEAD", 1)
    monkeypatch.setattr(services.jobs.claim, "SPREAD", 1)
    submit(engine, settings, application())
    first, second, third = queued(engine)
    sent: list[str] = []
    relay(engine, sent.extend, 30.0)
    held = claim_unsent(engine, "worker", LONG_LEASE_S)
    assert held is not None
    assert (held.job_id, held.token, held.spec.task_index) == (second, 1, 1)
    assert claim(engine, second, "another", LONG_LEASE_S) is None
    assert finish(engine, held, outcome_of(held))
    assert claim(engine, first, "worker", LONG_LEASE_S)
    relay(engine, sent.extend, 30.0)
    assert sent == [first, third]
    assert claim_unsent(engine, "worker", LONG_LEASE_S) is None


def test_processes_at_hand_take_each_job_once(engine: Engine, settings: Settings) -> None:
    """Every one of them wants the oldest; whoever finds it taken goes without."""
    application_id, _ = submit(engine, settings, application())
    ended: list[bool] = []

    def work() -> None:
        while not ApplicationState(state_of(engine, application_id)[0]).final:
            held = claim_unsent(engine, "worker", LONG_LEASE_S)
            if held is not None:
                ended.append(finish(engine, held, outcome_of(held)))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(services.jobs.claim, "SPREAD", 1)
        threads = [threading.Thread(target=work) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert ended == [True] * 7
    assert state_of(engine, application_id)[0] == ApplicationState.SUCCEEDED
    assert_history_is_sound(engine, application_id)
