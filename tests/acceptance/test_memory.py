"""A solver process that has held too much memory is replaced between two jobs, and no job is lost to it."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

from sqlalchemy import select

from services.jobs.submit import submit
from shared.contracts.application import ApplicationRequest
from shared.db.engine import make_engine, reading
from shared.db.migrate import upgrade
from shared.db.tables import Application, Job
from shared.domain import ApplicationState
from shared.settings import Settings
from tests.service.requests import HOME

TIMEOUT_S = 300.0
COARSE = {"scheme": "radau", "degree": 1, "intervals": 10, "control": "voltage"}


def test_a_process_over_its_limit_does_one_job(home: Path) -> None:
    settings = Settings(home=home)
    upgrade(settings.database_url)
    engine = make_engine(settings.database_url)
    tasks = [{"start_rad": [stroke] * 6, "end_rad": HOME, "payload_kg": 0.0} for stroke in (0.2, 0.3)]
    request = ApplicationRequest(name="two", tasks=tasks, transcription=COARSE)
    application_id, _ = submit(engine, settings, request)
    any_process_is_over = {"ARMATURE_HOME": str(home), "ARMATURE_WORKERS": "1", "ARMATURE_SOLVER_MEMORY_MB": "1"}
    processes = [
        subprocess.Popen([sys.executable, "-m", module], env={**os.environ, **any_process_is_over})
        for module in ("worker.relay", "worker.main")
    ]
    try:
        deadline = time.monotonic() + TIMEOUT_S
        state = None
        while state not in (ApplicationState.SUCCEEDED, ApplicationState.FAILED):
            assert time.monotonic() < deadline
            time.sleep(0.1)
            with reading(engine) as session:
                state = session.get_one(Application, application_id).state
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait(TIMEOUT_S)
    with reading(engine) as session:
        jobs = session.execute(select(Job.worker, Job.attempts).where(Job.application_id == application_id)).all()
    engine.dispose()
    assert state == ApplicationState.SUCCEEDED
    assert [job.attempts for job in jobs] == [1] * len(jobs)
    assert len({job.worker for job in jobs}) == len(jobs), "a process did two jobs"
