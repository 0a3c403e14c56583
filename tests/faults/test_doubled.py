"""Messages that come again and again, and jobs that end at the same moment: everything happens once."""

from __future__ import annotations

import threading
from collections import Counter

from sqlalchemy import Engine, select

from services.jobs.claim import Claim, claim
from services.jobs.finish import finish
from services.jobs.submit import submit
from shared.db.engine import reading
from shared.db.tables import Job, Outbox
from shared.dispatch.broker import celery_app, queue_size
from shared.settings import Settings
from tests.faults.conftest import Count, Measured
from tests.faults.history import assert_true_to_its_word, attempts
from tests.faults.service import START_S, Service, moves
from tests.service.queue_actions import LONG_LEASE_S, drain, outcome_of, queued

WORKERS = 4
TASKS = 6


def test_each_message_delivered_ten_times_to_four_workers(service: Service) -> None:
    """Through all stages, each solve is begun once."""
    service.solves_take(0.2)
    for _ in range(WORKERS):
        service.start("worker", ARMATURE_WORKERS="1", ARMATURE_LEASE_S="30")
    service.submit(TASKS)
    service.start("tenfold relay")
    service.wait_for_the_end()
    assert Counter(service.executions()) == {
        "reconcile - -1": 1,
        **{f"codesign - {k}": 1 for k in range(TASKS)},
        **{f"motions two_step {k}": 1 for k in range(TASKS)},
    }
    assert attempts(service.engine) == {1}
    assert_true_to_its_word(service.engine, service.accepted)


def test_the_last_two_jobs_of_a_stage_finish_together(engine: Engine, settings: Settings, count: Count) -> None:
    """One of them plans the next stage."""
    accepted = []
    for _ in range(count("last jobs of a stage together")):
        accepted.append(submit(engine, settings, moves(2))[0])
        claims = [held for job_id in queued(engine) if (held := claim(engine, job_id, "worker", LONG_LEASE_S))]
        assert len(claims) == 2
        _at_once(engine, claims)
        with reading(engine) as session:
            stages = session.scalars(select(Job.stage).where(Job.application_id == accepted[-1])).all()
        assert Counter(stages) == {"codesign": 2, "reconcile": 1}
        drain(engine)
    assert_true_to_its_word(engine, accepted)


def test_the_relay_killed_between_publish_and_mark(service: Service, count: Count, measured: Measured) -> None:
    """Messages are doubled with every kill; each solve is begun once."""
    kills = count("relay killed")
    for _ in range(kills):
        service.submit(1)
        relay = service.start("dying relay")
        relay.join(START_S)
        assert relay.exitcode == -9
    with reading(service.engine) as session:
        assert set(session.scalars(select(Outbox.sent))) == {0}, "a kill came after the mark"
    doubled = kills * (kills + 1) // 2  # each relay sent what all before it had sent
    assert queue_size(celery_app(service.settings.broker_url)) == doubled, "a kill came before the publishing"
    service.start("relay")
    service.start("worker", ARMATURE_LEASE_S="30")
    service.wait_for_the_end()
    executions = service.executions()
    assert len(executions) == 3 * kills  # a co-design, a reconcile and a motion of each application
    assert attempts(service.engine) == {1}
    assert_true_to_its_word(service.engine, service.accepted)
    measured(f"{kills} kills, {doubled} messages for {kills} jobs, {len(executions)} solves of {3 * kills} jobs")


def _at_once(engine: Engine, claims: list[Claim]) -> None:
    barrier = threading.Barrier(len(claims))
    accepted: list[bool] = []

    def end(held: Claim) -> None:
        barrier.wait()
        accepted.append(finish(engine, held, outcome_of(held)))

    threads = [threading.Thread(target=end, args=(held,)) for held in claims]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert accepted == [True] * len(claims)
