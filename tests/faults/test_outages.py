"""Broker and database killed and started again, with jobs queued, submissions coming in and solves at hand."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import psycopg
import pytest

from shared.settings import Settings
from tests.faults.brokers import Broker, broker_of
from tests.faults.conftest import Count, Measured
from tests.faults.history import assert_true_to_its_word, attempts
from tests.faults.service import (
    RECOVERY_S,
    SHORT_LEASES,
    START_S,
    Service,
    kill_family,
    moves,
    running_service,
    wait_until,
)
from tests.servers import Server, postgres_server, redis_server

MID_COMMIT_US = 50_000
"""How long Postgres waits in each commit for others to join, so that a kill can fall into it."""
CLIENTS = 4


@pytest.fixture
def broker(service: Service) -> Broker:
    """The service's broker, to be broken."""
    return broker_of(service.settings, service.redis)


@pytest.fixture
def postgres_to_kill(tmp_path: Path) -> Iterator[Service]:
    """A Postgres that writes to disk, with leases that outlive its absence."""
    options = {"commit_delay": str(MID_COMMIT_US), "commit_siblings": "0"}
    with postgres_server(fsync=True, settings=options) as server, redis_server() as broker:
        _skip_unless_owned(server)
        leases = {**SHORT_LEASES, "lease_s": 30.0}
        settings = Settings(home=tmp_path / "home", database_url=server.url, broker_url=broker.url, **leases)
        with running_service(settings, postgres=server, redis=broker) as service:
            yield service


def test_the_whole_queue_is_lost(service: Service, broker: Broker, count: Count, measured: Measured) -> None:
    """Redis killed without AOF, or the folder deleted: the jobs are in the database, and are sent again."""
    jobs = count("jobs queued in the broker")
    service.submit(jobs)
    service.start("relay")
    wait_until(lambda: broker.queued() == jobs, START_S)
    broker.lose()
    since = time.monotonic()
    wait_until(lambda: broker.queued() == jobs, RECOVERY_S, since)
    sent_again_s = time.monotonic() - since
    service.start("worker", ARMATURE_LEASE_S="30")
    service.wait_for_the_end(4 * RECOVERY_S)
    assert attempts(service.engine) == {1}
    assert_true_to_its_word(service.engine, service.accepted)
    measured(
        f"{jobs} jobs queued again {sent_again_s:.1f} s after the broker lost them, done after "
        f"{time.monotonic() - since:.1f} s"
    )


def test_submissions_while_the_broker_is_away(
    service: Service, broker: Broker, count: Count, measured: Measured
) -> None:
    """Every one is accepted; they run when it is back."""
    away_s = count("broker away [s]")
    http = service.start_api()
    service.start("relay")
    service.start("worker")
    service.submit(1)
    service.wait_for_the_end()  # all of them have been connected
    broker.go_away()
    back = time.monotonic() + away_s
    while time.monotonic() < back:
        service.accepted.append(_submit(http))
        time.sleep(0.25)
    assert service.unfinished() == len(service.accepted) - 1
    broker.come_back()
    since = time.monotonic()
    service.wait_for_the_end()
    assert_true_to_its_word(service.engine, service.accepted)
    measured(
        f"{len(service.accepted) - 1} applications accepted in {away_s} s without a broker, all done "
        f"{time.monotonic() - since:.1f} s after it was back"
    )


def test_postgres_killed_in_mid_commit(postgres_to_kill: Service, count: Count, measured: Measured) -> None:
    """Whatever was acknowledged is there afterwards, and is done. What was not may be there: then it is done too."""
    service = postgres_to_kill
    assert service.postgres is not None
    http = service.start_api()
    service.start("relay")
    service.start("worker")
    stop = threading.Event()
    clients = [threading.Thread(target=_submit_until, args=(service, http, stop)) for _ in range(CLIENTS)]
    for client in clients:
        client.start()
    for _ in range(count("Postgres killed in mid-commit")):
        known = len(service.accepted)
        wait_until(lambda known=known: len(service.accepted) > known, START_S)
        _wait_for_a_commit(service.postgres)
        service.postgres.kill()
        service.postgres.start()
    stop.set()
    for client in clients:
        client.join()
    service.engine.dispose()
    service.wait_for_the_end(4 * RECOVERY_S)
    measured(f"{len(service.accepted)} applications acknowledged by a Postgres killed in mid-commit, all done")
    assert_true_to_its_word(service.engine, service.accepted)


def test_the_api_killed_in_mid_submission(service: Service, count: Count, measured: Measured) -> None:
    """As with Postgres: for SQLite the API's process is the one that commits."""
    service.start("relay")
    service.start("worker")
    for _ in range(count("Postgres killed in mid-commit")):
        http, stop, known = service.start_api(), threading.Event(), len(service.accepted)
        clients = [threading.Thread(target=_submit_until, args=(service, http, stop)) for _ in range(CLIENTS)]
        for client in clients:
            client.start()
        wait_until(lambda known=known: len(service.accepted) >= known + CLIENTS, START_S)
        kill_family(service.latest("api"))
        stop.set()
        for client in clients:
            client.join()
    service.wait_for_the_end()
    measured(f"{len(service.accepted)} applications acknowledged by an API killed in mid-submission, all done")
    assert_true_to_its_word(service.engine, service.accepted)


def test_a_database_killed_in_mid_solve_costs_no_attempt(postgres_to_kill: Service) -> None:
    """The solves end while Postgres is away; their results are recorded when it is back, by the same claims."""
    service = postgres_to_kill
    assert service.postgres is not None
    service.solves_take(60.0)
    service.submit()
    service.start("relay")
    service.start("worker")
    wait_until(lambda: len(service.held()) == 2, START_S)
    service.postgres.kill()
    service.solves_take(0.0)
    time.sleep(2.0)
    service.postgres.start()
    service.engine.dispose()
    service.wait_for_the_end()
    assert_true_to_its_word(service.engine, service.accepted)
    assert attempts(service.engine) == {1}


def _submit(http: httpx.Client) -> str:
    answer = http.post("/v1/applications", json=moves(1).model_dump(mode="json", exclude_unset=True))
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


def _submit_until(service: Service, http: httpx.Client, stop: threading.Event) -> None:
    """What fails was not acknowledged."""
    body = moves(1).model_dump(mode="json", exclude_unset=True)
    while not stop.is_set():
        try:
            answer = http.post("/v1/applications", json=body)
        except httpx.TransportError:
            continue
        if answer.status_code == 202:
            service.accepted.append(answer.json()["id"])
        else:
            assert answer.status_code in (500, 503), answer.text
            time.sleep(0.05)


def _wait_for_a_commit(server: Server) -> None:
    """Until a session is in the middle of a commit: its own statement, or the end of one that is a transaction."""
    writing = "(query = 'COMMIT' OR query LIKE 'WITH %INSERT%')"
    committing = (
        f"SELECT count(*) FROM pg_stat_activity WHERE state = 'active' AND {writing} AND pid <> pg_backend_pid()"
    )
    with psycopg.connect(server.url, autocommit=True) as connection:
        deadline = time.monotonic() + START_S
        while not connection.execute(committing).fetchone() > (0,):
            assert time.monotonic() < deadline


def _skip_unless_owned(server: Server) -> None:
    if not server.owned:
        pytest.skip("the server of the environment must not be killed")
