"""Sweeps over HTTP: every combination becomes an application, all or none, and their results one table."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import Engine

from api.app import create_app
from services.jobs.keys import create_key
from shared.settings import Settings
from tests.service.queue_actions import DESIGN, drain
from tests.service.requests import body, grid
from tests.service.test_keys import bearer


@pytest.fixture
def client(settings: Settings) -> Iterator[TestClient]:
    """The API; few combinations fit into a sweep."""
    with TestClient(create_app(settings.model_copy(update={"max_sweep_points": 6}))) as client:
        yield client


def sweep(**changes: Any) -> dict[str, Any]:
    """A valid sweep of four applications, with some fields replaced."""
    base = grid(objective={"kind": "weighted"}, motor={"voltage_limit_V": 90.0})
    axes = {"objective.alpha": [0.0, 0.5], "motor.turns_per_tooth": [40, 50]}
    return {"name": "four", "application": base, "axes": axes, "tags": ["front"], **changes}


def test_each_combination_is_an_application(client: TestClient) -> None:
    answer = client.post("/v1/sweeps", json=sweep())
    assert answer.status_code == 202
    assert answer.json()["applications"] == 4
    found = client.get(answer.headers["location"]).json()
    assert [tuple(point["values"].values()) for point in found["points"]] == [(0, 40), (0, 50), (0.5, 40), (0.5, 50)]
    assert (found["state"], found["counts"]) == ("queued", {"queued": 4})
    for point in found["points"]:
        asked = client.get(f"/v1/applications/{point['application_id']}/inputs").json()
        assert asked["objective"]["alpha"] == point["values"]["objective.alpha"]
        assert asked["motor"]["turns_per_tooth"] == point["values"]["motor.turns_per_tooth"]
        assert asked["motor"]["voltage_limit_V"] == 90.0
    assert len(client.get("/v1/applications", params={"tag": "front"}).json()["items"]) == 4


def test_table_of_results(client: TestClient, engine: Engine) -> None:
    url = client.post("/v1/sweeps", json=sweep(axes={"objective.alpha": [0.2, 0.8]})).headers["location"]
    assert "retry-after" in client.get(url).headers
    drain(engine)
    answer = client.get(url)
    assert "retry-after" not in answer.headers
    found = answer.json()
    assert (found["state"], found["counts"]) == ("succeeded", {"succeeded": 2})
    for point in found["points"]:
        four_tasks = {
            "tasks": 4,
            "objective": 4.0,
            "weighted_objective": 4.0,
            "worst_objective": 1.0,
            "time_s": 4.0,
            "energy_V2s": 8.0,
            "electrical_energy_J": 12.0,
        }
        assert point["totals"] == {"own": four_tasks, "two_step": four_tasks}
        assert point["designs_mm"] == {"two_step": DESIGN["design_mm"]}
    rows = list(csv.DictReader(io.StringIO(client.get(url, headers={"Accept": "text/csv"}).text)))
    assert [(row["objective.alpha"], row["method"]) for row in rows] == [
        ("0.2", "own"),
        ("0.2", "two_step"),
        ("0.8", "own"),
        ("0.8", "two_step"),
    ]
    assert (rows[1]["energy_V2s"], rows[1]["motor_6_L_mm"], rows[0]["motor_6_L_mm"]) == ("8.0", "30.0", "")


def test_totals_have_the_tasks_weights(client: TestClient, engine: Engine) -> None:
    """Of three tasks one fails, and one of the others counts fourfold in one of two applications."""
    url = client.post("/v1/sweeps", json=sweep(application=body(), axes={"tasks[1].weight": [1.0, 4.0]})).headers[
        "location"
    ]
    drain(engine, failing=frozenset({0}))
    totals = [point["totals"]["own"] for point in client.get(url).json()["points"]]
    assert [(one["objective"], one["weighted_objective"]) for one in totals] == [(2.0, 2.0), (2.0, 5.0)]


def test_gear_ratios(client: TestClient) -> None:
    each = [60.0, 70.0, 80.0, -90.0, 100.0, 110.0]
    asked = sweep(application=body(), axes={"robot_changes.gear_ratio": [80, each]})
    found = client.get(client.post("/v1/sweeps", json=asked).headers["location"]).json()
    inputs = [client.get(f"/v1/applications/{point['application_id']}/inputs").json() for point in found["points"]]
    assert [one["robot"]["gear_ratio"] for one in inputs] == [[80.0] * 6, each]


@pytest.mark.parametrize(
    ("changes", "field", "limit"),
    [
        ({"axes": {"objective.alpha": [0.1] * 7}}, "axes", "at most 6 combinations"),
        ({"axes": {"objective.alpha": [0.5, 1.5]}}, "application.objective.alpha", "objective.alpha=1.5"),
        ({"axes": {"objective.beta": [1]}}, "application.objective.beta", "unknown field"),
        ({"axes": {"name.first": ["a"]}}, "axes.name.first", "no such field"),
        ({"axes": {"robot_changes.gear_ratio": [0]}}, "application.robot_changes.gear_ratio", "must not be 0"),
        ({"axes": {"robot_changes.gear_ratio": [[1, 2]]}}, "application.robot_changes.gear_ratio", "6 joints"),
        (
            {"axes": {"robot_changes.link_mass_scale": [[1, 2]]}},
            "application.robot_changes.link_mass_scale",
            "6 joints",
        ),
        ({"axes": {}}, "axes", "at least 1"),
    ],
)
def test_a_refused_sweep_leaves_nothing(client: TestClient, changes: dict[str, Any], field: str, limit: str) -> None:
    asked = sweep(**changes)
    asked["application"] = asked["application"] | {"objective": {"kind": "weighted", "alpha": 0.5}}
    answer = client.post("/v1/sweeps", json=asked)
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["field"] == field
    assert limit in error["limit"]
    assert client.get("/v1/applications").json()["items"] == client.get("/v1/sweeps").json()["items"] == []


def test_the_same_key_gives_the_same_sweep(client: TestClient) -> None:
    first, again = (client.post("/v1/sweeps", json=sweep(), headers={"Idempotency-Key": "k"}) for _ in range(2))
    assert first.json()["id"] == again.json()["id"]
    other = client.post("/v1/sweeps", json=sweep(name="other"), headers={"Idempotency-Key": "k"})
    assert other.status_code == 409
    assert [(item["name"], item["counts"]) for item in client.get("/v1/sweeps").json()["items"]] == [
        ("four", {"queued": 4})
    ]


def test_cancel_and_delete(client: TestClient) -> None:
    url = client.post("/v1/sweeps", json=sweep()).headers["location"]
    assert client.post(f"{url}/cancel").json()["counts"] == {"cancelled": 4}
    assert client.delete(url).status_code == 204
    assert client.get(url).status_code == 404
    assert client.get("/v1/applications").json()["items"] == []


def test_a_sweep_belongs_to_its_key(settings: Settings, engine: Engine) -> None:
    (_, mine), (_, other) = create_key(engine, "mine"), create_key(engine, "other")
    with TestClient(create_app(settings.model_copy(update={"api_keys_required": True}))) as client:
        url = client.post("/v1/sweeps", json=sweep(), headers=bearer(mine)).headers["location"]
        assert client.get("/v1/sweeps", headers=bearer(other)).json()["items"] == []
        for method, path in (("GET", url), ("POST", f"{url}/cancel"), ("DELETE", url)):
            assert client.request(method, path, headers=bearer(other)).status_code == 404
        assert client.get(url, headers=bearer(mine)).json()["counts"] == {"queued": 4}
