"""Bad input: refused over HTTP with the field, the value and the limit, and nothing stored."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient

from api.app import create_app
from armature.application_file import read_application, read_sweep
from shared.db.migrate import upgrade
from shared.settings import Settings
from tests.service.requests import HOME, POSE, body, grid
from tests.service.test_examples import EXAMPLES, SWEEPS

MOVE = {"start_rad": POSE, "end_rad": HOME}


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """The API on an empty SQLite database."""
    settings = Settings(home=tmp_path_factory.mktemp("home"))
    upgrade(settings.database_url)
    with TestClient(create_app(settings)) as client:
        yield client


def tasks(**changes: Any) -> dict[str, Any]:
    """One task, with some fields replaced."""
    return body(tasks=[{**MOVE, **changes}])


REFUSED = {
    "start outside the joint range": (tasks(start_rad=[0, 2, 0, 0, 0, 0]), "tasks[0].start_rad[1]", 2.0, "1.88496"),
    "grid outside the joint range": (
        grid(tasks={"grid": {"stroke": [0.2, 2.5], "payload_kg": [0]}}),
        "tasks.grid.stroke[1]",
        2.5,
        "joint 2 allows -1.88496 to 1.88496 rad",
    ),
    "speed over the rotor's": (
        tasks(end_speed_rad_s=[0, 0, 4, 0, 0, 0]),
        "tasks[0].end_speed_rad_s[2]",
        4.0,
        "3.14159",
    ),
    "negative payload": (tasks(payload_kg=-0.5), "tasks[0].payload_kg", -0.5, "greater than or equal to 0"),
    "payload not a number": (tasks(payload_kg="heavy"), "tasks[0].payload_kg", "heavy", "valid number"),
    "payload in quotes": (tasks(payload_kg="2"), "tasks[0].payload_kg", "2", "valid number"),
    "NaN": (tasks(start_rad=[float("nan"), 0, 0, 0, 0, 0]), "tasks[0].start_rad[0]", "nan", "finite"),
    "infinity": (tasks(payload_kg=float("inf")), "tasks[0].payload_kg", "inf", "finite"),
    "unknown robot": (body(robot="kuka"), "robot", "kuka", "presets are gen3"),
    "robot of no form": (body(robot=5), "robot", 5, "a preset's name"),
    "robot without fields": (body(robot={"name": "mine"}), "robot.", None, "missing"),
    "bounds upside down": (body(motor={"bounds_mm": {"L": [100, 20]}}), "motor.bounds_mm.L", "[100.0, 20.0]", "lower"),
    "bounds of no dimension": (body(motor={"bounds_mm": {"length": [1, 2]}}), "motor.bounds_mm.length", None, "'L'"),
    "no motor in the bounds": (body(motor={"mass_limit_kg": 0.01}), "motor", None, "motor"),
    "winding that does not exist": (body(motor={"slots": 10}), "motor.slots", 10, "3"),
    "energy without duration": (body(objective={"kind": "energy"}), "tasks[0].duration_s", None, "duration"),
    "weighted without alpha": (body(objective={"kind": "weighted"}), "objective.alpha", None, "between 0"),
    "alpha without weighted": (body(objective={"kind": "time", "alpha": 0.5}), "objective.alpha", 0.5, "weighted"),
    "alpha over 1": (body(objective={"kind": "weighted", "alpha": 1.5}), "objective.alpha", 1.5, "less than or equal"),
    "time bounds upside down": (
        body(objective={"final_time_bounds_s": [2, 1]}),
        "objective.final_time_bounds_s",
        "[2.0, 1.0]",
        "low < high",
    ),
    "seven angles": (tasks(start_rad=[0] * 7), "tasks[0].start_rad", None, "6 joints, this lists 7"),
    "empty task list": (body(tasks=[]), "tasks", "[]", "at least one"),
    "empty grid": (grid(tasks={"grid": {"stroke": [], "payload_kg": [1]}}), "tasks.grid.stroke", "[]", "at least 1"),
    "tasks of no form": (body(tasks="many"), "tasks", "many", "a list of tasks"),
    "missing start": (body(tasks=[{"end_rad": HOME}]), "tasks[0].start_rad", None, "is missing"),
    "unknown field": (body(colour="red"), "colour", "red", "unknown field; known are name, robot, "),
    "unknown field in a task": (tasks(speed=2), "tasks[0].speed", 2, "unknown field; known are name, start_rad, "),
    "slip in a task's field": (tasks(payload=2), "tasks[0].payload", 2, "unknown field; did you mean payload_kg?"),
    "slip beside a missing field": (
        body(tasks=[{"start": POSE, "end_rad": HOME}]),
        "tasks[0].start",
        None,
        "did you mean start_rad",
    ),
    "slip in a grid": (
        grid(tasks={"grid": {"strokes": [0.2], "payload_kg": [0]}}),
        "tasks.grid.strokes",
        "[0.2]",
        "did you mean stroke?",
    ),
    "slip at the top": (body(objektive={"kind": "time"}), "objektive", None, "did you mean objective?"),
    "slip in a motor": (body(motor={"air_gap": 0.5}), "motor.air_gap", 0.5, "did you mean air_gap_mm"),
    "slip in a URDF's settings": (
        body(robot={"urdf": "<robot/>", "gear_ratios": 100}),
        "robot.gear_ratios",
        100,
        "did you mean gear_ratio?",
    ),
    "two tasks of one name": (
        body(tasks=[{**MOVE, "name": "a"}, {**MOVE, "name": "a"}]),
        "tasks[1].name",
        "a",
        "differ",
    ),
    "list without an empirical task": (body(compare=["empirical"]), "empirical_task", None, "needs"),
    "empirical task that is not there": (body(empirical_task=3), "empirical_task", 3, "0 to 2"),
    "empirical task of no name": (body(empirical_task="nil"), "empirical_task", "nil", "no task"),
    "unknown method": (body(method="magic"), "method", "magic", "two_step"),
    "degree 6": (body(transcription={"degree": 6}), "transcription.degree", 6, "less than or equal to 5"),
    "half an interval": (body(transcription={"intervals": 2.5}), "transcription.intervals", 2.5, "integer"),
    "no start": (body(starts=0), "starts", 0, "greater than or equal to 1"),
    "more starts than allowed": (body(starts=17), "starts", 17, "less than or equal to 16"),
    "no name": ({"tasks": [MOVE]}, "name", None, "is missing"),
    "too many tasks": (
        grid(tasks={"grid": {"stroke": [0.01 * k for k in range(60)], "payload_kg": [0.1 * k for k in range(60)]}}),
        "tasks",
        3600,
        "at most 2000",
    ),
}


@pytest.mark.parametrize("case", REFUSED, ids=list(REFUSED))
def test_refused_with_field_value_and_limit(client: TestClient, case: str) -> None:
    sent, field, value, limit = REFUSED[case]
    answer = client.post("/v1/applications", content=json.dumps(sent), headers={"content-type": "application/json"})
    assert answer.status_code == 422, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    error = answer.json()["errors"][0]
    assert error["field"].startswith(field)
    if value is not None:
        assert error["value"] == value
    assert limit in error["limit"], error
    assert client.get("/v1/applications").json()["items"] == []


def test_every_error_is_listed(client: TestClient) -> None:
    sent = tasks(start_rad=[9] * 6, end_speed_rad_s=[0, 0, 0, 0, 0, 9])
    fields = [error["field"] for error in client.post("/v1/applications", json=sent).json()["errors"]]
    assert fields == [*(f"tasks[0].start_rad[{k}]" for k in range(6)), "tasks[0].end_speed_rad_s[5]"]


def test_a_body_that_is_not_json(client: TestClient) -> None:
    answer = client.post("/v1/applications", content=b'{"name":', headers={"content-type": "application/json"})
    assert answer.status_code == 400
    assert "JSON" in answer.json()["detail"]


def test_a_huge_body_announced_or_not(client: TestClient) -> None:
    headers = {"content-type": "application/json"}
    announced = client.post("/v1/applications", content=b" " * 50_000_000, headers=headers)
    streamed = client.post("/v1/applications", content=(b" " * 1_000_000 for _ in range(50)), headers=headers)
    for answer in (announced, streamed):
        assert answer.status_code == 413
        assert "2000000 bytes" in answer.json()["detail"]


@pytest.mark.parametrize(
    "path", ["", "/tasks", "/tasks/0", "/tasks/0/trajectory", "/design", "/designs", "/comparison"]
)
def test_an_unknown_application(client: TestClient, path: str) -> None:
    answer = client.get(f"/v1/applications/nothing{path}")
    assert answer.status_code == 404
    assert answer.json()["detail"] == "there is no application nothing"


def test_a_robot_that_is_no_arm(client: TestClient) -> None:
    preset = client.get("/v1/robots/ur5").json()
    answer = client.post("/v1/robots", json={**preset, "link_mass_kg": [1, 2, 3]})
    assert answer.status_code == 422
    assert "link_mass_kg" in answer.json()["errors"][0]["field"]
    assert client.get("/v1/robots/none").status_code == 404


def test_examples_are_accepted(client: TestClient) -> None:
    for path in EXAMPLES:
        answer = client.post("/v1/applications", json=read_application(path))
        assert answer.status_code == 202, f"{path.name}: {answer.text}"
    for path in SWEEPS:
        answer = client.post("/v1/sweeps", json=read_sweep(path))
        assert answer.status_code == 202, f"{path.name}: {answer.text}"
