"""The OpenAPI document against the server that serves it: whatever is asked, the answer is one that it describes.

Schemathesis makes requests from the document: at the bounds of every field, at random, valid and not, and in sequences
that use what earlier answers named. Nothing may be answered with 500, nor with a status, a content type or a body that
the document does not know.
"""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import schemathesis
import uvicorn
from fastapi.testclient import TestClient
from schemathesis.specs.openapi.schemas import OpenApiSchema
from sqlalchemy import Engine

from api.app import create_app
from services.codesign.solver import SolverOptions
from services.jobs.claim import claim
from services.jobs.execute import execute
from services.jobs.finish import finish
from services.jobs.submit import submit
from services.jobs.work import load_work
from shared.contracts.application import ApplicationRequest
from shared.settings import Settings
from tests.servers import free_port
from tests.service.queue_actions import LONG_LEASE_S, outcome_of, queued, state_of
from tests.service.requests import body

TIMEOUT_S = 20.0
LONGEST_RUN_S = 270.0
LONGEST_ANSWER_S = 60.0

ALWAYS = """
color = false
request-timeout = 60.0
checks.positive_data_acceptance.enabled = false
"""
"""A request that its schema allows may still be refused: whether an arm reaches a pose is no matter of schemas."""

FEW = """
generation.deterministic = true
generation.max-examples = 4
phases.stateful.generation.max-examples = 10
"""
IN_SHORT = {"sqlite": FEW, "postgresql": f"{FEW}\nphases.coverage.enabled = false"}
"""The bounds of every field once, a few requests at random and some sequences for each database: about a minute."""


@contextmanager
def served(settings: Settings) -> Iterator[str]:
    """The API on a free port."""
    port = free_port()
    server = uvicorn.Server(uvicorn.Config(create_app(settings), port=port, log_config=None, access_log=False))
    thread = threading.Thread(target=server.run)
    thread.start()
    deadline = time.monotonic() + TIMEOUT_S
    while not server.started:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    try:
        yield f"http://127.0.0.1:{port}"
    finally:
        server.should_exit = True
        thread.join()


@contextmanager
def worked_on(engine: Engine) -> Iterator[None]:
    """Stand-in solves in the background, so that there are results to ask for, and event streams end."""
    stop = threading.Event()

    def work() -> None:
        while not stop.wait(0.05):
            for job_id in queued(engine):
                if held := claim(engine, job_id, "worker", LONG_LEASE_S):
                    finish(engine, held, outcome_of(held))

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def ask_anything(settings: Settings, engine: Engine, folder: Path, how: str) -> str:
    """Let Schemathesis try the API, configured by `how`; returns its report, which has found nothing wrong."""
    configuration = folder / "schemathesis.toml"
    configuration.write_text(ALWAYS + how)
    with served(settings) as url, worked_on(engine):
        command = ["schemathesis.cli", "--config-file", str(configuration), "run", f"{url}/v1/openapi.json"]
        run = subprocess.run(
            [sys.executable, "-m", *command],
            capture_output=True, text=True, cwd=folder, check=False, timeout=LONGEST_RUN_S,
        )  # fmt: skip
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout


def test_whatever_is_asked(settings: Settings, engine: Engine, tmp_path: Path) -> None:
    ask_anything(settings, engine, tmp_path, IN_SHORT[engine.dialect.name])


@pytest.fixture
def described(settings: Settings) -> Iterator[OpenApiSchema]:
    """The server by its document."""
    app = create_app(settings)
    with TestClient(app):  # which closes its connections
        yield schemathesis.openapi.from_asgi("/v1/openapi.json", app)


def solved(engine: Engine, settings: Settings) -> str:
    """An application with real results."""
    task = {"name": "lift", "start_rad": [0.2] * 6, "end_rad": [0.0] * 6}
    asked = {"name": "one", "tasks": [task], "transcription": {"intervals": 10}}
    application_id, _ = submit(engine, settings, ApplicationRequest.model_validate(asked))
    while jobs := queued(engine):
        held = claim(engine, jobs[0], "worker", LONG_LEASE_S)
        assert held is not None
        work = load_work(engine, held)
        assert work is not None
        assert finish(engine, held, execute(work, SolverOptions(), lambda _: False))
    assert state_of(engine, application_id)[0] == "succeeded"
    return application_id


def test_every_answer_there_is(described: OpenApiSchema, settings: Settings, engine: Engine) -> None:
    """Each GET is answered, with what its schema says, once there are results."""
    posted = described["/v1/sweeps"]["POST"]
    sweep = {"name": "two", "application": body(objective={"kind": "weighted"}), "axes": {"objective.alpha": [0.2, 1]}}
    answer = posted.Case(body=sweep, media_type="application/json").call_and_validate()
    assert answer.status_code == 202
    cancel = described["/v1/sweeps/{sweep_id}/cancel"]["POST"]
    cancel.Case(path_parameters={"sweep_id": answer.json()["id"]}).call_and_validate()
    named: dict[str, Any] = {"application_id": solved(engine, settings), "sweep_id": answer.json()["id"]}
    named |= {"robot_id": "ur5", "task": 0}
    answered = 0
    for result in described.get_all_operations():
        operation = result.ok()
        if operation.method.upper() != "GET":
            continue
        parameters = {name: value for name, value in named.items() if f"{{{name}}}" in operation.path}
        for accept in ("application/json", "text/csv"):
            case = operation.Case(path_parameters=parameters, headers={"Accept": accept})
            response = case.call(timeout=LONGEST_ANSWER_S)
            assert response.status_code == 200, (operation.path, response.text)
            case.validate_response(response)
        answered += 1
    assert answered > 20
