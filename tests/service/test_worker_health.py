"""The worker's health check: silent, stuck, or well."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time

import pytest
from sqlalchemy import Engine, text

from services.jobs.claim import claim
from services.jobs.submit import submit
from services.jobs.workers import sign_of_life
from shared.db.engine import make_engine, transaction
from shared.settings import Settings
from tests.service.queue_actions import LONG_LEASE_S, queued
from tests.service.requests import application
from worker import sign_of_life as health


def test_a_silent_worker(engine: Engine, settings: Settings) -> None:
    assert "no worker of here" in str(health.complaint(settings, "here"))
    sign_of_life(engine, "elsewhere:1", "elsewhere", 2)
    assert health.complaint(settings, "here") is not None
    sign_of_life(engine, "here:1", "here", 2)
    assert health.complaint(settings, "here") is None
    with transaction(engine) as session:
        session.execute(text("UPDATE workers SET seen_at = seen_at - 46"))
    assert health.complaint(settings, "here") is not None


def test_a_worker_that_takes_nothing(engine: Engine, settings: Settings) -> None:
    submit(engine, settings, application())
    sign_of_life(engine, "here:1", "here", 2)
    assert health.complaint(settings, "here") is None
    with transaction(engine) as session:
        session.execute(text("UPDATE jobs SET created_at = created_at - 901"))
    assert "holds none" in str(health.complaint(settings, "here"))
    assert claim(engine, queued(engine)[0], "here:2", LONG_LEASE_S) is not None  # a process of its pool
    assert health.complaint(settings, "here") is None


def test_without_a_database_nothing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ARMATURE_DATABASE_URL", "postgresql://nobody@127.0.0.1:1/nothing")
    assert health.main() == 0


def test_a_process_forked_while_the_parent_writes_can_write(
    settings: Settings, engine: Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The pool replaces a lost process while the parent may just be saying that it lives."""
    writes, stop = threading.Event(), threading.Event()

    def slow_sign_of_life(engine: Engine, *_: object) -> None:
        with transaction(engine) as session:
            session.execute(text("UPDATE workers SET processes = 1"))
            writes.set()
            time.sleep(0.3)

    monkeypatch.setattr(health, "sign_of_life", slow_sign_of_life)
    monkeypatch.setattr("shared.db.engine.SQLITE_BUSY_TIMEOUT_S", 2.0)
    parent = threading.Thread(target=health.keep_saying, args=(settings, stop))
    parent.start()
    try:
        assert writes.wait(10)
        child = os.fork()
        if child == 0:
            try:
                sign_of_life(make_engine(settings.database_url), "child", "here", 1)
            except BaseException:  # nothing may leave a forked test process
                os._exit(1)
            os._exit(0)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    finally:
        stop.set()
        parent.join()


def test_solver_processes_give_way() -> None:
    """As much as is set, and no less than whoever started them."""
    asked = {**os.environ, "ARMATURE_SOLVER_NICENESS": "7"}
    before = os.getpriority(os.PRIO_PROCESS, 0)
    program = "import os; from worker.tasks import _process; _process(); print(os.getpriority(os.PRIO_PROCESS, 0))"
    said = subprocess.run([sys.executable, "-c", program], env=asked, capture_output=True, text=True, check=True)
    assert int(said.stdout) == min(before + 7, 19)
