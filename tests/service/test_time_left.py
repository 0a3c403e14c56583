"""The time left: never from a rate that includes the compiler; and whether somebody waits for one."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import Engine, update

from services.codesign.kernels import build_once
from services.codesign.solver import IterationReport
from services.jobs import views
from services.jobs.claim import Claim, claim, report, report_compiling
from services.jobs.events import events_after
from services.jobs.finish import finish
from services.jobs.submit import submit
from shared.contracts.states import Progress
from shared.db.engine import transaction
from shared.db.tables import Job
from shared.settings import Settings
from tests.service.queue_actions import LONG_LEASE_S, outcome_of, queued, take
from tests.service.requests import application, body
from worker.heartbeat import Heartbeat

COMPILE_S = 60.0
USUAL_S = 2.0
TASKS = 10


def ten_tasks(engine: Engine, settings: Settings) -> str:
    """An application of ten co-designs, one reconcile and ten motions."""
    task = body()["tasks"][0]
    tasks = [{**task, "name": f"move {k}"} for k in range(TASKS)]
    return submit(engine, settings, application(tasks=tasks, compare=[]))[0]


def progress(engine: Engine, application_id: str) -> Progress:
    """As people get it."""
    return views.status(engine, application_id).progress


def take_as(engine: Engine, worker: str) -> Claim:
    """Claim the first queued job."""
    held = claim(engine, queued(engine)[0], worker, LONG_LEASE_S)
    assert held is not None
    return held


def end(engine: Engine, held: Claim, seconds: float, ago: float = 0.0) -> None:
    """Finish a job as if it had taken so long, and had ended some time ago."""
    assert finish(engine, held, outcome_of(held))
    ended = Job.finished_at - ago
    with transaction(engine) as session:
        session.execute(update(Job).where(Job.id == held.job_id).values(finished_at=ended, started_at=ended - seconds))


def test_jobs_that_waited_for_the_compiler_do_not_count(engine: Engine, settings: Settings) -> None:
    """Two workers compile for a minute in their first jobs; three more jobs take 2 s each, 16 are left."""
    application_id = ten_tasks(engine, settings)
    assert progress(engine, application_id).eta_s is None
    first, second = take_as(engine, "one"), take_as(engine, "two")
    end(engine, first, COMPILE_S, ago=4 * USUAL_S)
    end(engine, second, COMPILE_S, ago=4 * USUAL_S)
    for k in range(3):
        assert progress(engine, application_id).eta_s is None
        end(engine, take_as(engine, "one"), USUAL_S, ago=(2 - k) * USUAL_S)
    still_running = take_as(engine, "two")
    assert progress(engine, application_id).eta_s == pytest.approx(8 * USUAL_S)
    end(engine, still_running, 3 * USUAL_S)  # it had to compile after all
    assert progress(engine, application_id).eta_s == pytest.approx(8 * USUAL_S)


def test_nobody_at_work_is_no_estimate(engine: Engine, settings: Settings) -> None:
    application_id = ten_tasks(engine, settings)
    for k in range(5):
        end(engine, take(engine), USUAL_S, ago=3600 - 10 * k)
    assert progress(engine, application_id).eta_s is None
    take(engine)
    assert progress(engine, application_id).eta_s == pytest.approx(16 * USUAL_S)


def test_compiling_is_told_while_the_job_does_it_and_no_longer(engine: Engine, settings: Settings) -> None:
    application_id = ten_tasks(engine, settings)
    first, second = take(engine), take(engine)
    assert not progress(engine, application_id).compiling
    report_compiling(engine, first)
    report(engine, second, IterationReport(attempt=0, iteration=1, objective=0.5))
    assert progress(engine, application_id).compiling
    report(engine, first, IterationReport(attempt=0, iteration=1, objective=0.5))
    assert not progress(engine, application_id).compiling
    report_compiling(engine, second)
    assert finish(engine, second, outcome_of(second))
    assert not progress(engine, application_id).compiling


def comes(true: Callable[[], bool], patience_s: float = 30.0) -> bool:
    """Whether something comes true in time."""
    deadline = time.monotonic() + patience_s
    while not true() and time.monotonic() < deadline:
        time.sleep(0.02)
    return true()


def test_a_heartbeat_tells_of_a_build_once(engine: Engine, settings: Settings, tmp_path: Path) -> None:
    application_id = ten_tasks(engine, settings)
    held = take(engine)
    quick = settings.model_copy(update={"cancel_poll_s": 0.01})

    def told() -> int:
        events = events_after(engine, application_id, 0).items
        return sum(event.kind == "compiling" for event in events)

    with Heartbeat(engine, quick, held) as heartbeat:

        def build(_compiler: str) -> None:
            assert comes(lambda: told() == 1)
            assert not comes(lambda: told() > 1, patience_s=0.3)
            assert progress(engine, application_id).compiling

        assert build_once(tmp_path / "cache" / "abc.so", build)
        heartbeat.should_stop(IterationReport(attempt=0, iteration=1, objective=0.5))
        assert comes(lambda: not progress(engine, application_id).compiling)
