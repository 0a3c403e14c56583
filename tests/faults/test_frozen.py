"""Processes that stop answering without being dead, and go on later as if nothing had happened."""

from __future__ import annotations

import json
import signal
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import make_url, select, text
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session

from services.jobs.claim import claim
from services.jobs.store import lock_application
from shared.db import engine as engines
from shared.db.engine import make_engine, reading
from shared.db.tables import Application
from shared.domain import ApplicationState
from shared.settings import Settings
from tests.faults.conftest import Count, Measured
from tests.faults.history import assert_true_to_its_word, recovery_times
from tests.faults.service import (
    RECOVERY_S,
    SHORT_LEASES,
    START_S,
    Service,
    kill_family,
    running_service,
    signal_family,
    spread,
    wait_until,
)
from tests.servers import postgres_server, redis_server
from tests.service.queue_actions import LONG_LEASE_S, queued
from worker.patience import passes

NEVER_S = 600.0


@pytest.fixture
def servers_to_freeze(tmp_path: Path) -> Iterator[Service]:
    """A Postgres and a Redis of its own."""
    with postgres_server() as server, redis_server() as broker:
        if not (server.owned and broker.owned):
            pytest.skip("the servers of the environment must not be frozen")
        settings = Settings(home=tmp_path / "home", database_url=server.url, broker_url=broker.url, **SHORT_LEASES)
        with running_service(settings, postgres=server, redis=broker) as service:
            yield service


@pytest.mark.parametrize("late", ["while another solves", "when all is done"])
def test_a_worker_frozen_past_its_lease(service: Service, measured: Measured, late: str) -> None:
    """Others have its jobs, or did them; when it goes on, its results come late, and are refused."""
    service.solves_take(NEVER_S)
    service.start("relay")
    frozen = service.start("worker")
    service.submit(2)
    wait_until(lambda: len(service.held()) == 2, START_S)
    lost = service.held()
    _freeze_outside_a_transaction(service, frozen)
    since = time.time()
    service.start("worker", ARMATURE_LEASE_S="30")
    wait_until(lambda: len(service.held()) == 2 and not {*service.held()} & {*lost}, RECOVERY_S)
    if late == "when all is done":
        service.solves_take(0.0)
        service.wait_for_the_end()
    signal_family(frozen, signal.SIGCONT)
    wait_until(lambda: _refused(service) == {claim.job_id for claim in lost}, RECOVERY_S)
    service.solves_take(0.0)
    service.wait_for_the_end()
    assert {*_states(service)} == {ApplicationState.SUCCEEDED}
    assert_true_to_its_word(service.engine, service.accepted)
    if late == "when all is done":
        times = recovery_times(service.engine, [(claim.job_id, claim.token, since) for claim in lost])
        measured(f"jobs of a frozen worker done by another: {spread(times)}; its late results refused")


def test_redis_frozen(servers_to_freeze: Service, count: Count, measured: Measured) -> None:
    """What is at hand goes on; what is submitted meanwhile runs afterwards; a worker lost meanwhile is noticed."""
    service, frozen_s = servers_to_freeze, count("Redis frozen [s]")
    assert service.redis is not None
    service.solves_take(NEVER_S)
    service.start("relay")
    worker = service.start("worker")
    service.submit(2)
    wait_until(lambda: len(service.held()) == 2, START_S)
    service.redis.freeze()
    back = time.monotonic() + frozen_s
    kill_family(worker)
    wait_until(lambda: not service.held(), RECOVERY_S)  # the sweep does not wait for Redis
    service.solves_take(0.0)
    service.start("worker")
    while time.monotonic() < back:
        service.submit(1)
        time.sleep(0.5)
    service.redis.thaw()
    since = time.monotonic()
    service.wait_for_the_end()
    measured(f"Redis frozen for {frozen_s} s: all done {time.monotonic() - since:.1f} s after")
    assert_true_to_its_word(service.engine, service.accepted)


def test_postgres_frozen(servers_to_freeze: Service, count: Count, measured: Measured) -> None:
    """Leases expire while nobody can renew them; each job still ends once."""
    service, frozen_s = servers_to_freeze, count("database frozen [s]")
    assert service.postgres is not None
    service.solves_take(NEVER_S)
    service.start("relay")
    service.start("worker")
    service.submit(4)
    wait_until(lambda: len(service.held()) == 2, START_S)
    service.postgres.freeze()
    service.solves_take(0.0)  # they end meanwhile
    time.sleep(frozen_s)
    service.postgres.thaw()
    since = time.monotonic()
    service.wait_for_the_end()
    measured(f"Postgres frozen for {frozen_s} s: all done {time.monotonic() - since:.1f} s after")
    assert_true_to_its_word(service.engine, service.accepted)


def test_sqlite_locked(tmp_path: Path, count: Count, measured: Measured) -> None:
    """The same for the embedded database, which has no process to freeze: somebody holds its one write lock."""
    locked_s = count("database frozen [s]")
    with running_service(Settings(home=tmp_path / "home", **SHORT_LEASES)) as service:
        service.solves_take(NEVER_S)
        service.start("relay")
        service.start("worker")
        service.submit(4)
        wait_until(lambda: len(service.held()) == 2, START_S)
        with closing(sqlite3.connect(service.settings.home / "armature.db", timeout=START_S)) as holder:
            holder.execute("BEGIN IMMEDIATE")
            service.solves_take(0.0)  # they end meanwhile
            time.sleep(locked_s)
            holder.execute("ROLLBACK")
        since = time.monotonic()
        service.wait_for_the_end()
        measured(f"SQLite locked for {locked_s} s: all done {time.monotonic() - since:.1f} s after")
        assert_true_to_its_word(service.engine, service.accepted)


@pytest.mark.true_length
def test_a_worker_killed_with_the_leases_of_production(service_of_production: Service, measured: Measured) -> None:
    """Nothing shortened: 45 s of lease, a sweep every 5 s, 60 s promised."""
    service = service_of_production
    service.solves_take(NEVER_S)
    service.start("relay")
    worker = service.start("worker")
    service.submit(2)
    wait_until(lambda: len(service.held()) == 2, START_S)
    held, killed, since = service.held(), time.time(), time.monotonic()
    kill_family(worker)
    service.solves_take(0.0)
    service.start("worker")
    wait_until(lambda: not service.unfinished(), RECOVERY_S, since)
    assert_true_to_its_word(service.engine, service.accepted)
    lost = [(claim.job_id, claim.token, killed) for claim in held]
    measured(f"a killed worker's jobs done again: {spread(recovery_times(service.engine, lost))}")


def test_a_lock_of_a_frozen_process_is_given_up(
    servers_to_freeze: Service, monkeypatch: pytest.MonkeyPatch, measured: Measured
) -> None:
    """Postgres ends a transaction in which nothing happens: its application does not hang on a frozen worker."""
    service = servers_to_freeze
    application_id = service.submit(1)
    monkeypatch.setattr(engines, "IDLE_IN_TRANSACTION_S", 1)
    frozen = make_engine(service.settings.database_url)
    with Session(frozen) as session:
        assert lock_application(session, application_id) is not None
        since = time.monotonic()
        assert claim(service.engine, queued(service.engine)[0], "another", LONG_LEASE_S) is not None
        measured(f"the lock was free after {time.monotonic() - since:.1f} s")
        with pytest.raises(DBAPIError) as ended:
            session.execute(text("SELECT 1"))  # the frozen one goes on
    assert passes(ended.value), "the worker waits, and finds that it is late"
    frozen.dispose()


def _freeze_outside_a_transaction(service: Service, process: object) -> None:
    """Of SQLite there is one writer: frozen in the middle of a write it stops the service until it goes on."""
    signal_family(process, signal.SIGSTOP)
    while service.settings.embedded and _is_being_written(service.settings.database_url):
        signal_family(process, signal.SIGCONT)
        time.sleep(0.1)  # to end its write, among others that want the processor
        signal_family(process, signal.SIGSTOP)


def _is_being_written(database_url: str) -> bool:
    with closing(sqlite3.connect(str(make_url(database_url).database), timeout=0.2, isolation_level=None)) as database:
        try:
            database.execute("BEGIN IMMEDIATE")
        except sqlite3.OperationalError:
            return True
        database.execute("ROLLBACK")
        return False


def _states(service: Service) -> list[str]:
    with reading(service.engine) as session:
        return list(session.scalars(select(Application.state)))


def _refused(service: Service) -> set[str]:
    """Jobs whose late finish was refused, from the workers' log."""
    lines = (service.settings.home / "log").read_text().splitlines()
    entries = [json.loads(line) for line in lines if line.startswith("{")]
    return {entry["job"] for entry in entries if entry.get("accepted") is False}
