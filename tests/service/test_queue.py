"""The queue over SQLite and Postgres: leases, fencing, stages, cancel. Solves are stand-ins here."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Sequence

import pytest
from sqlalchemy import Engine, func, select, text, update

import services.jobs.claim
from services.jobs import outbox, views
from services.jobs.cancel import cancel, delete_application
from services.jobs.claim import Claim, claim, claim_unsent, release, renew
from services.jobs.finish import Outcome, finish
from services.jobs.outbox import recall, relay
from services.jobs.submit import IdempotencyConflictError, submit
from services.jobs.sweep import sweep
from shared.db.engine import reading, transaction
from shared.db.tables import Base, Job, Outbox
from shared.domain import ApplicationState, JobState
from shared.settings import Settings
from tests.service.queue_actions import (
    EXPIRED_LEASE_S,
    LONG_LEASE_S,
    assert_history_is_sound,
    drain,
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


def test_an_application_runs_through_its_stages(engine: Engine, settings: Settings) -> None:
    application_id, new = submit(engine, settings, application())
    assert new
    assert state_of(engine, application_id) == (ApplicationState.QUEUED, None)
    held = take(engine)
    assert state_of(engine, application_id)[0] == ApplicationState.RUNNING
    assert finish(engine, held, outcome_of(held))
    drain(engine)
    assert state_of(engine, application_id) == (ApplicationState.SUCCEEDED, None)
    assert_history_is_sound(engine, application_id)
    status = views.status(engine, application_id)
    assert [(s.name, s.total, s.succeeded) for s in status.progress.stages] == [
        ("codesign", 3, 3),
        ("reconcile", 1, 1),
        ("motions", 3, 3),
    ]
    assert status.progress.done == status.progress.total == 7
    assert status.finished_at is not None


def test_a_failed_task_is_named_and_the_others_go_on(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    drain(engine, failing=frozenset({1}))
    assert state_of(engine, application_id)[0] == ApplicationState.COMPLETED_WITH_FAILURES
    assert_history_is_sound(engine, application_id)
    status = views.status(engine, application_id)
    assert [(task.index, task.reason) for task in status.excluded_tasks] == [(1, "cannot be done")]
    failed = views.task(engine, application_id, 1)
    assert (failed.state, failed.reason, failed.own, failed.methods) == ("failed", "cannot be done", None, {})


def test_all_tasks_failed(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    drain(engine, failing=frozenset({0, 1, 2}))
    assert state_of(engine, application_id)[0] == ApplicationState.FAILED
    assert_history_is_sound(engine, application_id)


def test_a_job_is_claimed_once(engine: Engine, settings: Settings) -> None:
    submit(engine, settings, application())
    job_id = queued(engine)[0]
    won: list[Claim] = []

    def compete() -> None:
        held = claim(engine, job_id, "worker", LONG_LEASE_S)
        if held is not None:
            won.append(held)

    threads = [threading.Thread(target=compete) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(won) == 1


def test_the_last_two_jobs_of_a_stage_finish_together(engine: Engine, settings: Settings) -> None:
    for _ in range(10):
        application_id, _ = submit(engine, settings, application())
        claims = [held for job_id in queued(engine) if (held := claim(engine, job_id, "worker", LONG_LEASE_S))]
        barrier = threading.Barrier(len(claims))

        def end(held: Claim, barrier: threading.Barrier = barrier) -> None:
            barrier.wait()
            assert finish(engine, held, outcome_of(held))

        threads = [threading.Thread(target=end, args=(held,)) for held in claims]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        jobs = rows(engine, select(Job.stage).where(Job.application_id == application_id))
        assert Counter(row.stage for row in jobs) == {"codesign": 3, "reconcile": 1}
        drain(engine)


def test_a_late_finish_is_refused(engine: Engine, settings: Settings) -> None:
    submit(engine, settings, application())
    late = take(engine, EXPIRED_LEASE_S)
    assert sweep(engine, max_attempts=3) == 1
    second = claim(engine, late.job_id, "another worker", LONG_LEASE_S)
    assert second is not None
    assert second.token == late.token + 1
    assert not finish(engine, late, outcome_of(late))
    assert not renew(engine, late, LONG_LEASE_S).mine
    assert finish(engine, second, outcome_of(second))
    assert not finish(engine, second, outcome_of(second))


def test_a_renewed_lease_is_not_swept(engine: Engine, settings: Settings) -> None:
    submit(engine, settings, application())
    held = take(engine, EXPIRED_LEASE_S)
    pulse = renew(engine, held, LONG_LEASE_S)
    assert (pulse.mine, pulse.cancelled) == (True, False)
    assert sweep(engine, max_attempts=3) == 0


def test_a_job_that_kills_its_worker_dies_after_three_attempts(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    deadly = queued(engine)[0]
    for _ in range(3):
        assert claim(engine, deadly, "worker", EXPIRED_LEASE_S) is not None
        assert sweep(engine, max_attempts=3) == 1
    assert claim(engine, deadly, "worker", LONG_LEASE_S) is None
    drain(engine)
    assert state_of(engine, application_id)[0] == ApplicationState.COMPLETED_WITH_FAILURES
    assert_history_is_sound(engine, application_id)
    dead = [task for task in views.tasks(engine, application_id, 0, 10).items if task.state == "dead"]
    assert [task.reason for task in dead] == ["its worker was lost 3 times"]


def test_cancel_while_queued(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    assert cancel(engine, application_id)
    assert state_of(engine, application_id)[0] == ApplicationState.CANCELLED
    assert_history_is_sound(engine, application_id)
    assert relay(engine, lambda job_ids: pytest.fail(f"sent {job_ids}"), 30.0) == 0


def test_cancel_while_running_waits_for_the_worker(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    held = take(engine)
    cancel(engine, application_id)
    assert state_of(engine, application_id)[0] == ApplicationState.RUNNING
    assert renew(engine, held, LONG_LEASE_S).cancelled
    assert finish(engine, held, Outcome(JobState.CANCELLED))
    assert state_of(engine, application_id)[0] == ApplicationState.CANCELLED
    assert_history_is_sound(engine, application_id)


def test_cancel_with_a_lost_worker(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    take(engine, EXPIRED_LEASE_S)
    cancel(engine, application_id)
    sweep(engine, max_attempts=3)
    assert state_of(engine, application_id)[0] == ApplicationState.CANCELLED
    assert_history_is_sound(engine, application_id)


def test_a_result_that_comes_after_the_cancel_plans_nothing(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    claims = [take(engine) for _ in range(3)]
    cancel(engine, application_id)
    for held in claims:
        assert finish(engine, held, outcome_of(held))
    assert state_of(engine, application_id)[0] == ApplicationState.CANCELLED
    assert queued(engine) == []


def test_cancel_of_a_final_application_changes_nothing(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    drain(engine)
    assert cancel(engine, application_id)
    assert state_of(engine, application_id)[0] == ApplicationState.SUCCEEDED
    assert not cancel(engine, "nothing")


def test_delete_removes_everything(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    held = take(engine)
    assert delete_application(engine, application_id)
    assert not finish(engine, held, outcome_of(held))
    assert renew(engine, held, LONG_LEASE_S).cancelled
    with reading(engine) as session:
        left = {
            table.name: session.scalar(select(func.count()).select_from(table)) for table in Base.metadata.sorted_tables
        }
    assert left == dict.fromkeys(left, 0)


def test_one_key_one_application(engine: Engine, settings: Settings) -> None:
    first, new = submit(engine, settings, application(), "key")
    second, again = submit(engine, settings, application(), "key")
    assert (first, new, again) == (second, True, False)
    with pytest.raises(IdempotencyConflictError, match="another body"):
        submit(engine, settings, application(name="other"), "key")


def test_concurrent_submissions_with_one_key(engine: Engine, settings: Settings) -> None:
    ids: list[str] = []
    threads = [
        threading.Thread(target=lambda: ids.append(submit(engine, settings, application(), "key")[0])) for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(ids) == 8
    assert len(set(ids)) == 1


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


def test_a_job_given_back_counts_no_attempt_and_is_sent_again(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    sent: list[str] = []
    relay(engine, sent.extend, 30.0)
    held = take(engine)
    assert release(engine, held)
    assert not release(engine, held)
    assert relay(engine, sent.extend, 30.0) == 1
    assert sent[-1] == held.job_id
    again = claim(engine, held.job_id, "worker", LONG_LEASE_S)
    assert again is not None
    assert again.token == held.token + 1
    assert rows(engine, select(Job.attempts).where(Job.id == held.job_id))[0].attempts == 1
    assert finish(engine, again, outcome_of(again))
    drain(engine)
    assert_history_is_sound(engine, application_id)


def test_a_job_given_back_after_a_cancel_is_cancelled(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    held = take(engine)
    cancel(engine, application_id)
    assert release(engine, held)
    assert state_of(engine, application_id)[0] == ApplicationState.CANCELLED
    assert_history_is_sound(engine, application_id)


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
