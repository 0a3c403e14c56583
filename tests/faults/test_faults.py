"""Workers killed in mid-solve, and a database killed under them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from sqlalchemy import Engine, select

from services.jobs.submit import submit
from shared.db.engine import make_engine, reading
from shared.db.migrate import upgrade
from shared.db.tables import Application, Job
from shared.domain import ApplicationState, JobState
from shared.settings import Settings
from tests.faults.history import assert_true_to_its_word
from tests.servers import descendants, postgres_database, postgres_server, redis_server
from tests.service.requests import application

LEASES = {"lease_s": 3.0, "heartbeat_s": 0.5, "cancel_poll_s": 0.2, "sweep_s": 0.5, "resend_after_s": 3.0}
RECOVERY_S = 60.0
KILLS = 3


@pytest.fixture(params=["embedded", "postgres and redis"])
def settings(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Settings]:
    if request.param == "embedded":
        yield Settings(home=tmp_path / "home", **LEASES)
        return
    with postgres_database(request.getfixturevalue("postgres")) as url, redis_server() as broker:
        yield Settings(home=tmp_path / "home", database_url=url, broker_url=broker.url, **LEASES)


@contextmanager
def process(module: str, settings: Settings, solve_s: float) -> Iterator[subprocess.Popen[bytes]]:
    """One of the service's processes, ended with all its children."""
    names = {"home", "database_url", "broker_url", *LEASES}
    given = {f"ARMATURE_{name.upper()}": str(getattr(settings, name)) for name in names}
    environment = {**os.environ, **given, "ARMATURE_WORKERS": "2", "ARMATURE_TEST_SOLVE_S": str(solve_s)}
    started = subprocess.Popen([sys.executable, "-m", module], env=environment, stdout=subprocess.DEVNULL)
    try:
        yield started
    finally:
        kill(started)


def kill(started: subprocess.Popen[bytes]) -> None:
    """SIGKILL to a process and all its children."""
    for pid in [started.pid, *descendants(started.pid)]:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    started.wait()


def running(engine: Engine) -> int:
    with reading(engine) as session:
        return len(session.scalars(select(Job.id).where(Job.state == JobState.RUNNING)).all())


def all_final(engine: Engine) -> bool:
    with reading(engine) as session:
        return all(ApplicationState(state).final for state in session.scalars(select(Application.state)))


def wait_until(holds: Callable[[], bool], within_s: float, since: float | None = None) -> None:
    """Wait for something that has to hold `within_s` of now, or of `since` (by `time.monotonic`)."""
    deadline = (time.monotonic() if since is None else since) + within_s
    while not holds():
        assert time.monotonic() < deadline, f"not within {within_s:g} s"
        time.sleep(0.05)


def test_workers_killed_in_mid_solve(settings: Settings) -> None:
    """Each kill takes a whole worker with a running job; the next worker does what is left."""
    upgrade(settings.database_url)
    engine = make_engine(settings.database_url)
    with process("worker.relay", settings, 0):
        accepted = []
        for _ in range(KILLS):
            accepted.append(submit(engine, settings, application())[0])
            with process("tests.faults.stand_in_worker", settings, 30.0) as victim:
                wait_until(lambda: running(engine) > 0, RECOVERY_S)
                kill(victim)
                killed = time.monotonic()
            with process("tests.faults.stand_in_worker", settings, 0.05):
                wait_until(lambda: all_final(engine), RECOVERY_S, since=killed)
        assert_true_to_its_word(engine, accepted)
    engine.dispose()


def test_a_database_killed_in_mid_solve_costs_no_attempt(tmp_path: Path) -> None:
    """The solves end while Postgres is away; their results are recorded when it is back, by the same claims."""
    with postgres_server(fsync=True) as server, redis_server() as broker:
        if not server.owned:
            pytest.skip("the server of the environment must not be killed")
        leases = {**LEASES, "lease_s": 20.0}
        settings = Settings(home=tmp_path / "home", database_url=server.url, broker_url=broker.url, **leases)
        upgrade(settings.database_url)
        engine = make_engine(settings.database_url)
        accepted, _ = submit(engine, settings, application())
        with process("worker.relay", settings, 0), process("tests.faults.stand_in_worker", settings, 1.0):
            wait_until(lambda: running(engine) == 2, RECOVERY_S)
            server.kill()
            time.sleep(2.0)
            server.start()
            engine.dispose()
            wait_until(lambda: all_final(engine), RECOVERY_S)
        assert_true_to_its_word(engine, [accepted])
        with reading(engine) as session:
            assert set(session.scalars(select(Job.attempts))) == {1}
        engine.dispose()
