"""What a report is made from, out of the store; and a request that gives the same again."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import httpx
import pytest
import yaml
from sqlalchemy import Engine
from starlette.testclient import TestClient

from api.app import create_app
from services.codesign.robot import preset_wire
from services.jobs.certificates import input_hash
from services.jobs.resolve import resolve
from services.jobs.resolved import ResolvedApplication
from shared.contracts.application import ApplicationRequest
from shared.settings import Settings
from tests.service.queue_actions import drain
from tests.service.requests import body, grid

UPLOAD = "01a2108084689b4a3d6f0c"
REQUESTS = {
    "poses": body(compare=["worst_case"], worst_case_task=1, tags=["cell 3"]),
    "grid": grid(objective={"kind": "energy"}, tasks={"grid": {"stroke": [0.2], "payload_kg": [0], "duration_s": 1.0}}),
    "weighted": grid(objective={"kind": "weighted", "alpha": 0.3}, motor={"air_gap_mm": 0.6}),
    "shared": grid(method="shared_optimum", objective={"kind": "time", "over_tasks": {"kind": "mix", "share": 0.5}}),
    "gears": grid(robot_changes={"gear_ratio": 80}, transcription={"preset": "paper"}),
    "upload": grid(robot=UPLOAD),
    "accuracy": grid(transcription={"accuracy": {"position_rad": 1e-4}}),
}


def understood(request: dict[str, Any]) -> ResolvedApplication:
    """As a server with one upload understands it, through JSON and back, as the database does."""
    uploads = {UPLOAD: {**preset_wire("ur5"), "name": "somebody's"}}
    meaning = resolve(ApplicationRequest.model_validate(request), uploads.get, 100)
    return ResolvedApplication.model_validate(meaning.model_dump(mode="json"))


@pytest.mark.parametrize("name", REQUESTS)
def test_the_request_of_a_report_is_understood_as_the_same(name: str) -> None:
    """Written as YAML and read back, on a server without the upload: every motion has the same hash of its inputs."""
    first = understood(REQUESTS[name])
    request = yaml.safe_load(yaml.safe_dump(first.as_request("again", ["cell 3"]), sort_keys=False))
    again = understood({**request, "name": "again"})
    assert again == first
    assert [input_hash(again, k, None) for k in range(len(again.tasks))] == [
        input_hash(first, k, None) for k in range(len(first.tasks))
    ]
    assert request["tags"] == ["cell 3"]


@pytest.fixture
def http(settings: Settings, engine: Engine) -> Iterator[httpx.Client]:
    with TestClient(create_app(settings)) as client:
        yield client


def test_one_that_still_waits_has_a_report(http: httpx.Client) -> None:
    """With what is known: its tasks and its request; not an error."""
    application = http.post("/v1/applications", json=body(name="waiting")).json()["id"]
    answer = http.get(f"/v1/applications/{application}/report")
    assert answer.status_code == 200, answer.text
    assert "<h1>waiting</h1>" in answer.text
    assert "There is no design yet." in answer.text
    assert "Not finished: 0 of" in answer.text
    assert "script-src" not in answer.headers["content-security-policy"]
    assert http.get("/v1/applications/nothing/report").status_code == 404


def test_one_whose_motions_are_gone_has_a_report(http: httpx.Client, engine: Engine) -> None:
    """As between a retry and the new solve: results are listed, and their motions are not there any more."""
    application = http.post("/v1/applications", json=body(name="solved without motions")).json()["id"]
    drain(engine)
    assert http.get(f"/v1/applications/{application}/tasks/0/trajectory").status_code == 404
    answer = http.get(f"/v1/applications/{application}/report")
    assert answer.status_code == 200, answer.text
    assert "<h1>solved without motions</h1>" in answer.text
