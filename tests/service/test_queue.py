"""The queue over SQLite and Postgres: leases, fencing, stages, cancel. Solves are stand-ins here."""

from __future__ import annotations

import threading
from collections import Counter
from typing import Any

import pytest
from sqlalchemy import Engine, func, select, text

from services.codesign.solver import IterationReport
from services.jobs import results, views
from services.jobs.cancel import cancel, delete_application
from services.jobs.claim import Claim, claim, release, renew, report
from services.jobs.events import events_after
from services.jobs.finish import Outcome, finish
from services.jobs.outbox import relay
from services.jobs.retry import NotRetryableError, retry
from services.jobs.submit import IdempotencyConflictError, submit
from services.jobs.sweep import sweep
from shared.db.engine import reading, transaction
from shared.db.tables import Application, Base, Job, JobTransition, Outbox, Stage
from shared.domain import ApplicationState, JobState
from shared.domain import Stage as StageName
from shared.settings import Settings
from tests.service.requests import application

LONG_LEASE_S = 60.0
EXPIRED_LEASE_S = -1.0

OWN = {
    "objective": 1.0,
    "final_time_s": 1.0,
    "energy_V2s": 2.0,
    "electrical_energy_J": 3.0,
    "copper_loss_J": 4.0,
    "recovered_energy_J": [0.0] * 6,
    "peaks": {},
    "rms": {},
    "certificate": {"kkt_residual": 1e-9, "limit_violation": 0.0},
    "solver_status": "Solve_Succeeded",
    "iterations": 30,
    "solve_time_s": 0.1,
}
DESIGN = {"design_mm": [[30.0, 20.0, 40.0, 2.0, 6.0, 7.0, 2.0]] * 6, "motors": []}


def outcome_of(held: Claim, failing: frozenset[int] = frozenset()) -> Outcome:
    """What a stand-in solve gives."""
    if held.spec.stage == StageName.RECONCILE:
        return Outcome(
            JobState.SUCCEEDED, summary={"methods": ["two_step"]}, designs={"mean": DESIGN, "two_step": DESIGN}
        )
    if held.spec.task_index in failing:
        return Outcome(JobState.FAILED, "cannot be done", summary={"solver_status": "Infeasible"})
    return Outcome(JobState.SUCCEEDED, value=1.0, summary=OWN | DESIGN)


def queued(engine: Engine) -> list[str]:
    """Ids of all queued jobs."""
    with reading(engine) as session:
        return list(session.scalars(select(Job.id).where(Job.state == JobState.QUEUED).order_by(Job.id)))


def take(engine: Engine, lease_s: float = LONG_LEASE_S) -> Claim:
    """Claim the first queued job."""
    held = claim(engine, queued(engine)[0], "worker", lease_s)
    assert held is not None
    return held


def drain(engine: Engine, failing: frozenset[int] = frozenset()) -> None:
    """Run everything that is queued, and what follows from it."""
    while jobs := queued(engine):
        for job_id in jobs:
            held = claim(engine, job_id, "worker", LONG_LEASE_S)
            if held is not None:
                assert finish(engine, held, outcome_of(held, failing))


def rows(engine: Engine, statement: Any) -> list[Any]:
    """Result rows."""
    with reading(engine) as session:
        return list(session.execute(statement))


def state_of(engine: Engine, application_id: str) -> tuple[str, str | None]:
    """State and reason."""
    with reading(engine) as session:
        row = session.get_one(Application, application_id)
        return row.state, row.reason


def assert_history_is_sound(engine: Engine, application_id: str) -> None:
    """Every job final exactly once, counters at zero, one reconcile at most."""
    final = [state for state in JobState if state.final]
    ends = Counter(
        row.job_id for row in rows(engine, select(JobTransition.job_id).where(JobTransition.to_state.in_(final)))
    )
    jobs = rows(engine, select(Job.id, Job.state, Job.stage).where(Job.application_id == application_id))
    assert set(ends) == {row.id for row in jobs}
    assert set(ends.values()) == {1}
    assert all(JobState(row.state).final for row in jobs)
    assert [row.remaining for row in rows(engine, select(Stage.remaining))] == [0] * len({row.stage for row in jobs})
    assert sum(row.stage == StageName.RECONCILE for row in jobs) <= 1


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
    assert relay(engine, lambda job_id: pytest.fail(f"sent {job_id}"), 30.0) == 0


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
    assert relay(engine, sent.append, resend_after_s=30.0) == 3
    assert sorted(sent) == queued(engine)
    assert relay(engine, sent.append, resend_after_s=30.0) == 0  # not yet
    with transaction(engine) as session:  # half a minute later
        session.execute(text("UPDATE outbox SET due_at = due_at - 31"))
    take(engine)
    assert relay(engine, sent.append, resend_after_s=30.0) == 2
    assert [row.sent for row in rows(engine, select(Outbox.sent).where(Outbox.due_at.is_not(None)))] == [2, 2]


def test_a_crash_between_publish_and_mark_doubles_and_loses_nothing(engine: Engine, settings: Settings) -> None:
    submit(engine, settings, application())
    sent: list[str] = []

    def crash_after_two(job_id: str) -> None:
        if len(sent) == 2:
            raise ConnectionError
        sent.append(job_id)

    with pytest.raises(ConnectionError):
        relay(engine, crash_after_two, 30.0)
    assert relay(engine, sent.append, 30.0) == 3
    assert Counter(sent).most_common()[-1][1] >= 1
    assert set(sent) == set(queued(engine))


def test_a_job_given_back_counts_no_attempt_and_is_sent_again(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    sent: list[str] = []
    relay(engine, sent.append, 30.0)
    held = take(engine)
    assert release(engine, held)
    assert not release(engine, held)
    assert relay(engine, sent.append, 30.0) == 1
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


def specs(engine: Engine, application_id: str) -> Counter[tuple[int, str, int, str]]:
    """(generation, stage, task, state) of all jobs."""
    statement = select(Job.generation, Job.stage, Job.task_index, Job.state).where(Job.application_id == application_id)
    return Counter(tuple(row) for row in rows(engine, statement))


def test_retry_does_again_only_what_failed_and_what_depends_on_it(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    drain(engine, failing=frozenset({1}))
    assert retry(engine, application_id)
    assert state_of(engine, application_id) == (ApplicationState.QUEUED, None)
    assert len(queued(engine)) == 1
    drain(engine)
    assert state_of(engine, application_id)[0] == ApplicationState.SUCCEEDED
    found = specs(engine, application_id)
    assert found[(0, "codesign", 1, "failed")] == 1
    assert found[(0, "reconcile", -1, "succeeded")] == 1  # the mean of two tasks: history
    assert all(found[(1, "codesign", task, "succeeded")] == 1 for task in range(3))
    assert found[(1, "reconcile", -1, "succeeded")] == 1
    assert all(found[(1, "motions", task, "succeeded")] == 1 for task in range(3))
    assert [task.state for task in views.tasks(engine, application_id, 0, 10).items] == ["succeeded"] * 3
    status = views.status(engine, application_id)
    assert [(s.name, s.total, s.succeeded) for s in status.progress.stages] == [
        ("codesign", 3, 3),
        ("reconcile", 1, 1),
        ("motions", 3, 3),
    ]


def test_retry_of_a_failed_motion_keeps_the_design(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    while jobs := queued(engine):
        for job_id in jobs:
            held = claim(engine, job_id, "worker", LONG_LEASE_S)
            assert held is not None
            motion = held.spec.stage == StageName.MOTIONS
            assert finish(engine, held, outcome_of(held, frozenset({2} if motion else ())))
    assert state_of(engine, application_id)[0] == ApplicationState.COMPLETED_WITH_FAILURES
    assert retry(engine, application_id)
    assert len(queued(engine)) == 1
    assert results.design(engine, application_id).design_mm == DESIGN["design_mm"]
    drain(engine)
    assert state_of(engine, application_id)[0] == ApplicationState.SUCCEEDED


def test_retry_after_a_cancel_goes_on_where_it_was(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    held = take(engine)
    assert finish(engine, held, outcome_of(held))
    cancel(engine, application_id)
    assert state_of(engine, application_id)[0] == ApplicationState.CANCELLED
    assert retry(engine, application_id)
    assert len(queued(engine)) == 2
    drain(engine)
    assert state_of(engine, application_id)[0] == ApplicationState.SUCCEEDED


def test_retry_is_refused_while_running_and_when_all_is_well(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    with pytest.raises(NotRetryableError, match="queued"):
        retry(engine, application_id)
    drain(engine)
    with pytest.raises(NotRetryableError, match="nothing to do again"):
        retry(engine, application_id)
    assert not retry(engine, "nothing")


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
    monkeypatch.setattr("services.jobs.store.MOST_EVENTS", 4)
    monkeypatch.setattr("services.jobs.store.PRUNE_EVERY", 2)
    application_id, _ = submit(engine, settings, application())
    drain(engine)
    found = events_after(engine, application_id, 0)
    assert found.pruned
    assert found.ended
    assert len(found.items) <= 6
    assert not events_after(engine, application_id, found.items[0].number).pruned
