"""Workers, and single processes of their pools, killed in mid-solve."""

from __future__ import annotations

import os
import signal
import time

from sqlalchemy import select

from services.jobs import views
from shared.db.engine import reading
from shared.db.tables import Job
from shared.domain import ApplicationState, JobState
from tests.faults.conftest import Count, Measured
from tests.faults.history import assert_true_to_its_word, recovery_times
from tests.faults.service import RECOVERY_S, START_S, Held, Service, kill_family, spread, wait_until
from tests.servers import descendants

Lost = tuple[str, int, float]
NEVER_S = 600.0
"""A solve that long is not over when its process is killed."""


def test_workers_killed_in_mid_solve(service: Service, count: Count, measured: Measured) -> None:
    """Each kill takes a whole worker with its running jobs; the next worker does what is left."""
    service.start("relay")
    lost: list[Lost] = []
    worker = service.start("worker")
    for _ in range(count("workers killed")):
        service.solves_take(NEVER_S)
        service.submit()
        wait_until(lambda: len(service.held()) == 2, START_S)
        held, killed = service.held(), time.time()
        kill_family(worker)
        service.solves_take(0.0)
        since = time.monotonic()
        worker = service.start("worker")
        wait_until(lambda: not service.unfinished(), RECOVERY_S, since)
        lost += [(claim.job_id, claim.token, killed) for claim in held]
    assert_true_to_its_word(service.engine, service.accepted)
    measured(f"{len(lost)} jobs lost with their workers, done again: {spread(recovery_times(service.engine, lost))}")


def test_pool_children_killed_in_mid_solve(service: Service, count: Count, measured: Measured) -> None:
    """A child is killed, its worker lives and starts another; the job is done again."""
    service.start("relay")
    worker = service.start("worker")
    lost: list[Lost] = []
    for _ in range(count("pool children killed")):
        service.solves_take(NEVER_S)
        service.submit(1)
        wait_until(service.held, START_S)
        held = _one(service.held())
        assert worker.pid is not None
        assert held.process in descendants(worker.pid)
        killed = time.time()
        os.kill(held.process, signal.SIGKILL)
        service.solves_take(0.0)
        service.wait_for_the_end(RECOVERY_S)
        lost.append((held.job_id, held.token, killed))
    assert worker.is_alive()
    assert_true_to_its_word(service.engine, service.accepted)
    measured(f"{len(lost)} jobs lost with their process, done again: {spread(recovery_times(service.engine, lost))}")


def test_killed_in_the_middle_of_a_finish(service: Service, count: Count) -> None:
    """Result and counter are one transaction: neither is there, and the job is done again."""
    kills = count("killed while counting")
    service.start("relay")
    service.start("worker that dies counting")
    for _ in range(kills):
        service.kill_when_counting()
        service.submit(1)
        service.wait_for_the_end(RECOVERY_S)
    assert len(service.executions()) >= 4 * kills  # a co-design twice, a reconcile, a motion
    assert_true_to_its_word(service.engine, service.accepted)


def test_a_job_that_kills_its_process_each_time(service: Service) -> None:
    """It is dead after three attempts; its neighbours succeed, and the application says what is missing."""
    service.kill_process_of_task(1)
    application_id = service.submit(4)
    service.start("relay")
    service.start("worker")
    service.wait_for_the_end(RECOVERY_S)
    assert_true_to_its_word(service.engine, service.accepted)
    assert service.executions().count("codesign - 1") == 3
    status = views.status(service.engine, application_id)
    assert status.state == ApplicationState.COMPLETED_WITH_FAILURES
    assert [(task.index, task.reason) for task in status.excluded_tasks] == [(1, "its worker was lost 3 times")]
    with reading(service.engine) as session:
        states = session.execute(select(Job.state, Job.attempts).where(Job.stage == "codesign")).all()
    assert sorted((state, attempts) for state, attempts in states if state == JobState.DEAD) == [(JobState.DEAD, 3)]
    assert sum(state == JobState.SUCCEEDED for state, _ in states) == 3


def test_a_job_that_raises_an_exception(service: Service) -> None:
    """It is tried once, and fails with what was raised; its process and its neighbours go on."""
    service.raise_in_task(1)
    application_id = service.submit(4)
    service.start("relay")
    service.start("worker")
    service.wait_for_the_end(RECOVERY_S)
    assert_true_to_its_word(service.engine, service.accepted)
    assert service.executions().count("codesign - 1") == 1
    status = views.status(service.engine, application_id)
    assert status.state == ApplicationState.COMPLETED_WITH_FAILURES
    said = [(task.index, task.reason) for task in status.excluded_tasks]
    assert said == [(1, "solving raised ArithmeticError: the matrix is singular")]
    with reading(service.engine) as session:
        ((state, attempts, reason),) = session.execute(
            select(Job.state, Job.attempts, Job.reason).where(Job.stage == "codesign", Job.task_index == 1)
        ).all()
    assert (state, attempts, reason) == (JobState.FAILED, 1, said[0][1])


def _one(held: list[Held]) -> Held:
    (claim,) = held
    return claim
