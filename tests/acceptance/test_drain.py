"""A worker that is told to end in mid-solve gives its job back, and the next one does it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Engine, select

from services.jobs.submit import submit
from shared.contracts.application import ApplicationRequest
from shared.db.engine import make_engine, reading
from shared.db.migrate import upgrade
from shared.db.tables import Application, Job, JobTransition
from shared.domain import JobState
from shared.settings import Settings
from tests.servers import descendants
from tests.service.requests import HOME

TIMEOUT_S = 120.0
DRAIN_S = 0.2


@contextmanager
def process(module: str, home: Path) -> Iterator[subprocess.Popen[bytes]]:
    """One of the service's processes."""
    environment = {**os.environ, "ARMATURE_HOME": str(home), "ARMATURE_WORKERS": "1", "ARMATURE_DRAIN_S": str(DRAIN_S)}
    started = subprocess.Popen([sys.executable, "-m", module], env=environment, stdout=subprocess.DEVNULL)
    try:
        yield started
    finally:
        started.terminate()
        started.wait(TIMEOUT_S)


def wait_until(holds: Callable[[], bool]) -> None:
    """Poll."""
    deadline = time.monotonic() + TIMEOUT_S
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def job_states(engine: Engine) -> list[tuple[str, int]]:
    """State and attempts of all jobs."""
    with reading(engine) as session:
        return [(row.state, row.attempts) for row in session.execute(select(Job.state, Job.attempts))]


def test_sigterm_in_mid_solve(home: Path) -> None:
    settings = Settings(home=home)
    upgrade(settings.database_url)
    engine = make_engine(settings.database_url)
    task = {"start_rad": [0.6] * 6, "end_rad": HOME, "payload_kg": 2.0}
    fine = {"intervals": 250, "control": "voltage"}
    request = ApplicationRequest(name="long", tasks=[task], transcription=fine, starts=8)  # several seconds
    application_id, _ = submit(engine, settings, request)
    with process("worker.relay", home):
        with process("worker.main", home) as worker:
            wait_until(lambda: job_states(engine) == [(JobState.RUNNING, 1)])
            time.sleep(0.5)  # well into the solve
            children = descendants(worker.pid)
            worker.send_signal(signal.SIGTERM)
            worker.wait(TIMEOUT_S)
            assert not [pid for pid in children if Path(f"/proc/{pid}").exists()]
        assert job_states(engine) == [(JobState.QUEUED, 0)]
        with process("worker.main", home):
            wait_until(lambda: all(state == JobState.SUCCEEDED for state, _ in job_states(engine)))
    with reading(engine) as session:
        assert session.get_one(Application, application_id).generation == 0
        history = session.execute(select(JobTransition.to_state, JobTransition.token).order_by(JobTransition.id)).all()
    assert [tuple(row) for row in history][:4] == [("running", 1), ("queued", 1), ("running", 2), ("succeeded", 2)]
    engine.dispose()
