"""Every log line is one JSON object, and names the request, the application and the job that it is about."""

from __future__ import annotations

import io
import json
import logging
import time
from collections.abc import Callable, Iterator
from typing import Any

import psycopg
import pytest
import structlog
from fastapi.testclient import TestClient
from sqlalchemy import Engine
from sqlalchemy.exc import OperationalError

import worker.heartbeat
import worker.patience
import worker.run_job
from api.app import create_app
from services.jobs.claim import claim
from services.jobs.submit import submit
from services.jobs.sweep import sweep
from shared.observability import configure_logging
from shared.settings import Settings
from tests.service.queue_actions import EXPIRED_LEASE_S, outcome_of, queued, take
from tests.service.requests import application, body
from worker.run_job import run_job

Lines = Callable[[str], list[dict[str, Any]]]

AWAY = OperationalError("SELECT 1", None, psycopg.OperationalError("gone"))


@pytest.fixture
def lines(monkeypatch: pytest.MonkeyPatch) -> Iterator[Lines]:
    """What was logged so far under a title; any line that is no JSON object is an error."""
    before, level, written = logging.root.handlers[:], logging.root.level, io.StringIO()
    monkeypatch.setattr("sys.stderr", written)
    configure_logging()

    def titled(event: str) -> list[dict[str, Any]]:
        said = [json.loads(line) for line in written.getvalue().splitlines()]
        return [line for line in said if line["event"] == event]

    yield titled
    structlog.reset_defaults()
    logging.root.handlers[:] = before
    logging.root.setLevel(level)


def test_a_request_and_its_application(settings: Settings, lines: Lines) -> None:
    with TestClient(create_app(settings)) as client:
        answer = client.post("/v1/applications", json=body())
        client.get(f"/v1/applications/{answer.json()['id']}/tasks")
    request, of = answer.headers["X-Request-Id"], answer.json()["id"]
    (accepted,) = lines("application accepted")
    assert (accepted["request"], accepted["application"], accepted["jobs"]) == (request, of, 3)
    submitted, listed = lines("request")
    assert (submitted["request"], submitted["status"]) == (request, 202)
    assert (listed["application"], listed["status"]) == (of, 200)
    assert listed["request"] != request


def test_a_job(engine: Engine, settings: Settings, lines: Lines, monkeypatch: pytest.MonkeyPatch) -> None:
    """Through an outage before its claim, and one of its heartbeat while it is solved."""
    application_id, _ = submit(engine, settings, application())
    first, *_ = queued(engine)
    outages = iter([AWAY])

    def interrupted(*arguments: Any) -> Any:
        for outage in outages:
            raise outage
        return claim(*arguments)

    def away(*_: Any) -> bool:
        raise AWAY

    def solve(work: Any, *_: Any) -> Any:
        deadline = time.monotonic() + 30.0
        while not lines("heartbeat failed"):
            assert time.monotonic() < deadline
            time.sleep(0.01)
        return outcome_of(work)

    monkeypatch.setattr(worker.run_job, "claim", interrupted)
    monkeypatch.setattr(worker.run_job, "execute", solve)
    monkeypatch.setattr(worker.heartbeat, "requests_of", away)
    run_job(engine, settings.model_copy(update={"cancel_poll_s": 0.01}), first)
    ids = {"job": first, "application": application_id, "stage": "codesign"}
    for event in ("job claimed", "heartbeat failed", "job finished"):
        assert ids.items() <= lines(event)[0].items(), event
    assert lines("waiting for the database")[0]["job"] == first
    run_job(engine, settings, first)
    assert lines("job not queued, message ignored")[0]["job"] == first


def test_a_lost_lease(engine: Engine, settings: Settings, lines: Lines) -> None:
    submit(engine, settings, application())
    held = take(engine, EXPIRED_LEASE_S)
    sweep(engine, max_attempts=3)
    (said,) = lines("lease expired")
    lost = {"job": held.job_id, "application": held.application_id, "worker": "worker", "attempt": 1}
    assert (lost | {"state": "queued"}).items() <= said.items()


def test_what_libraries_say(lines: Lines) -> None:
    with structlog.contextvars.bound_contextvars(job="a job"):
        try:
            raise ArithmeticError("singular")
        except ArithmeticError:
            logging.getLogger("celery.worker").exception("task %s", "failed")
    (said,) = lines("task failed")
    assert (said["job"], said["logger"], said["level"]) == ("a job", "celery.worker", "error")
    assert said["exception"].endswith("ArithmeticError: singular")
