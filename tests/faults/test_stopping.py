"""Workers that are told to end, one after the other under load; cancels at every moment of an application's life."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from sqlalchemy import Engine, select

from services.jobs import views
from services.jobs.cancel import cancel
from services.jobs.claim import claim
from services.jobs.finish import finish
from services.jobs.submit import submit
from shared.db.engine import reading
from shared.db.tables import Job
from shared.domain import ApplicationState, JobState
from shared.settings import Settings
from tests.faults.conftest import Count, Measured
from tests.faults.history import assert_true_to_its_word, attempts
from tests.faults.service import RECOVERY_S, START_S, Service, moves, spread, wait_until
from tests.servers import descendants
from tests.service.queue_actions import LONG_LEASE_S, outcome_of, queued

NEVER_S = 600.0
DRAIN_S = 1.0
GRACE_S = 40.0
"""What docker-compose.yml allows beyond the time in which solves may end: its grace period less `drain_s`."""
ENOUGH = 3
"""Applications under way, of six tasks each, that keep two workers busy."""
NO_LEASE_LOST = {"ARMATURE_LEASE_S": "30", "ARMATURE_DRAIN_S": str(DRAIN_S)}


def test_workers_told_to_end_in_mid_solve(service: Service, count: Count, measured: Measured) -> None:
    """Each is out within its grace; the jobs it gives back have not been attempted."""
    service.solves_take(NEVER_S)
    service.start("relay")
    service.submit(3)
    took = []
    for _ in range(count("workers restarted")):
        worker = service.start("worker", **NO_LEASE_LOST)
        wait_until(lambda: len(service.held()) == 2, START_S)
        assert worker.pid is not None
        children, asked = descendants(worker.pid), time.monotonic()
        worker.terminate()
        worker.join(DRAIN_S + GRACE_S)
        took.append(time.monotonic() - asked)
        assert worker.exitcode == 0
        assert not [pid for pid in children if _alive(pid)]
        with reading(service.engine) as session:
            assert {(s, a) for s, a in session.execute(select(Job.state, Job.attempts))} == {(JobState.QUEUED, 0)}
    service.solves_take(0.0)
    service.start("worker", **NO_LEASE_LOST)
    service.wait_for_the_end()
    assert attempts(service.engine) == {1}
    assert_true_to_its_word(service.engine, service.accepted)
    measured(f"out after SIGTERM with {DRAIN_S:g} s for solves at hand: {spread(took)}")


def test_a_rolling_restart_under_load(service: Service, count: Count, measured: Measured) -> None:
    """Two workers, replaced in turn while applications come in: nothing is lost and no attempt is counted."""
    service.solves_take(0.5)
    service.start("relay")
    workers = [service.start("worker", **NO_LEASE_LOST) for _ in range(2)]
    stop = threading.Event()
    load = threading.Thread(target=_submit_until, args=(service, stop))
    load.start()
    for k in range(count("workers restarted")):
        wait_until(lambda: len(service.held()) > 2, START_S)  # both have work
        workers.append(service.start("worker", **NO_LEASE_LOST))
        workers[k].terminate()
        workers[k].join(DRAIN_S + GRACE_S)
        assert workers[k].exitcode == 0
    stop.set()
    load.join()
    service.solves_take(0.0)
    service.wait_for_the_end(2 * RECOVERY_S)
    assert attempts(service.engine) == {1}
    assert_true_to_its_word(service.engine, service.accepted)
    measured(f"{len(service.accepted)} applications during {count('workers restarted')} restarts, each job tried once")


def test_cancel_while_queued_and_while_running(service: Service, measured: Measured) -> None:
    """Queued: at once. Running: as soon as the solver is asked. Nothing starts afterwards."""
    queued_one = service.submit()
    assert cancel(service.engine, queued_one)
    assert views.status(service.engine, queued_one).state == ApplicationState.CANCELLED
    service.solves_take(NEVER_S)
    service.start("relay")
    service.start("worker", **NO_LEASE_LOST)
    running_one = service.submit()
    wait_until(lambda: len(service.held()) == 2, START_S)
    asked = time.monotonic()
    assert cancel(service.engine, running_one)
    service.wait_for_the_end()
    measured(f"running jobs cancelled after {time.monotonic() - asked:.2f} s")
    assert views.status(service.engine, running_one).state == ApplicationState.CANCELLED
    assert len(service.executions()) == 2
    assert_true_to_its_word(service.engine, service.accepted)


def test_cancel_while_the_last_job_finishes(engine: Engine, settings: Settings, count: Count) -> None:
    """Whichever comes first, there is one end, and after a cancel nothing is planned."""
    accepted: list[str] = []
    for _ in range(count("cancel against finish")):
        application_id, _ = submit(engine, settings, moves(1))
        accepted.append(application_id)
        held = claim(engine, queued(engine)[0], "worker", LONG_LEASE_S)
        assert held is not None
        barrier = threading.Barrier(2)

        def run(act: Callable[[], bool], barrier: threading.Barrier = barrier) -> None:
            barrier.wait()
            act()

        acts = (partial(finish, engine, held, outcome_of(held)), partial(cancel, engine, application_id))
        threads = [threading.Thread(target=run, args=(act,)) for act in acts]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert queued(engine) == []  # where the finish came first, the reconcile was planned and then cancelled
        assert views.status(engine, application_id).state == ApplicationState.CANCELLED
    assert_true_to_its_word(engine, accepted)


def _submit_until(service: Service, stop: threading.Event) -> None:
    """Always more than enough to do, however fast the machine is."""
    while not stop.wait(0.1):
        if service.unfinished() < ENOUGH:
            service.submit(6)


def _alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
