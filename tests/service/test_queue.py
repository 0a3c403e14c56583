"""The queue over SQLite and Postgres: leases, fencing, stages, cancel. Solves are stand-ins here."""

from __future__ import annotations

import threading
from collections import Counter

import pytest
from sqlalchemy import Engine, func, select

from services.jobs import views
from services.jobs.cancel import cancel, delete_application
from services.jobs.claim import Claim, claim, release, renew
from services.jobs.finish import Outcome, finish
from services.jobs.outbox import relay
from services.jobs.submit import IdempotencyConflictError, submit
from services.jobs.sweep import sweep
from shared.db.engine import reading
from shared.db.tables import Base, Job
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
