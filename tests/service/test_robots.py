"""Robots over HTTP: uploaded, named in applications, deleted; and whatever is sent as a URDF is answered quickly."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from api.app import create_app
from armature.application_file import read_application, read_robot
from services.codesign.robot import preset_wire
from shared.db.migrate import upgrade
from shared.settings import Settings

EXAMPLES = Path(__file__).parents[2] / "examples"
URDF = (EXAMPLES / "my_arm.urdf").read_text()
SETTINGS = {"gear_ratio": 100.0}

LONGEST_ANSWER_S = 10.0
"""No bound on speed, but on what a hostile text can cost."""


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """The API on an empty SQLite database."""
    configuration = Settings(home=tmp_path_factory.mktemp("home"))
    upgrade(configuration.database_url)
    with TestClient(create_app(configuration)) as client:
        yield client


def upload(client: TestClient, robot: dict[str, Any]) -> str:
    answer = client.post("/v1/robots", json=robot)
    assert answer.status_code == 201, answer.text
    assert answer.headers["location"] == f"/v1/robots/{answer.json()['id']}"
    return str(answer.json()["id"])


def application(robot: Any, joints: int = 3) -> dict[str, Any]:
    task = {"name": "move", "start_rad": [0.2] * joints, "end_rad": [0.0] * joints}
    return {"name": "mine", "robot": robot, "tasks": [task]}


def test_a_urdf_becomes_a_robot_that_applications_name(client: TestClient) -> None:
    robot_id = upload(client, {"urdf": URDF, **SETTINGS})
    robot = client.get(f"/v1/robots/{robot_id}").json()
    assert robot["name"] == "my_arm"
    assert len(robot["gear_ratio"]) == 3
    listed = client.get("/v1/robots").json()["items"]
    assert [item["kind"] for item in listed if item["id"] == robot_id] == ["upload"]
    accepted = client.post("/v1/applications", json=application(robot_id))
    assert accepted.status_code == 202, accepted.text
    inputs = client.get(f"/v1/applications/{accepted.json()['id']}/inputs").json()
    assert inputs["robot"] == robot


def test_the_robot_format_comes_back_as_it_went(client: TestClient) -> None:
    wire = preset_wire("ur5") | {"name": "mine", "viscous_friction_Nms_rad": [0.1] * 6}
    assert client.get(f"/v1/robots/{upload(client, wire)}").json() == wire


def test_a_deleted_robot_stays_in_the_applications_that_use_it(client: TestClient) -> None:
    robot_id = upload(client, {"urdf": URDF, **SETTINGS})
    accepted = client.post("/v1/applications", json=application(robot_id)).json()["id"]
    assert client.delete(f"/v1/robots/{robot_id}").status_code == 204
    assert client.get(f"/v1/robots/{robot_id}").status_code == 404
    assert client.delete(f"/v1/robots/{robot_id}").status_code == 404
    assert len(client.get(f"/v1/applications/{accepted}/inputs").json()["robot"]["gear_ratio"]) == 3
    refused = client.post("/v1/applications", json=application(robot_id))
    assert refused.status_code == 422
    assert refused.json()["errors"][0]["field"] == "robot"


def test_presets_cannot_be_deleted(client: TestClient) -> None:
    answer = client.delete("/v1/robots/ur5")
    assert answer.status_code == 404
    assert "preset" in answer.json()["detail"]


def test_the_client_puts_the_urdf_in_place_of_its_name(client: TestClient) -> None:
    request = read_application(EXAMPLES / "my_arm.yaml")
    assert request["robot"]["urdf"] == URDF
    assert client.post("/v1/applications", json=request).status_code == 202
    assert read_robot(EXAMPLES / "my_arm.yaml") == request["robot"]


def test_the_server_opens_no_file(client: TestClient) -> None:
    answer = client.post("/v1/applications", json=application({"urdf": str(EXAMPLES / "my_arm.urdf"), **SETTINGS}))
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == "robot.urdf"


REFUSED = {
    "no gear": ({"urdf": URDF}, "gear_ratio", "is missing"),
    "gear zero": ({"urdf": URDF, "gear_ratio": 0.0}, "gear_ratio", "must not be 0"),
    "gear of no joint": ({"urdf": URDF, "gear_ratio": {"toe": 3.0}}, "gear_ratio.toe", "'yaw', 'pitch', 'elbow'"),
    "unknown setting": ({"urdf": URDF, **SETTINGS, "colour": "red"}, "colour", "unknown"),
    "urdf of no text": ({"urdf": 5, **SETTINGS}, "urdf", "string"),
    "xacro": ({"urdf": "<sdf/>", **SETTINGS}, "urdf", "'robot'"),
    "too many joints": (
        {
            **{k: v * 4 if isinstance(v, list) and k not in ("gravity_m_s2", "tool_home") else v
               for k, v in preset_wire("ur5").items()},
        },
        "gear_ratio",
        "at most 20",
    ),
    "unprintable name": (preset_wire("ur5") | {"name": "a\7b"}, "name", "printed"),
    "endless name": (preset_wire("ur5") | {"name": "a" * 300}, "name", "200"),
    "number beyond floats": (preset_wire("ur5") | {"link_mass_kg": [10**400] * 6}, "link_mass_kg", "numbers"),
    "number beyond arms": (preset_wire("ur5") | {"link_mass_kg": [1e300] * 6}, "link_mass_kg", "1e+09"),
    "negative friction": (preset_wire("ur5") | {"coulomb_friction_Nm": [-1.0] * 6}, "coulomb_friction_Nm", "negative"),
    "friction for five": (preset_wire("ur5") | {"coulomb_friction_Nm": [1.0] * 5}, "coulomb_friction_Nm", "6 joints"),
    "joint that stands": (preset_wire("ur5") | {"joint_speed_limit_rad_s": [0] * 6}, "joint_speed_limit_rad_s", "0"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED, ids=str)
def test_refusals_name_the_field(client: TestClient, case: str) -> None:
    body, field, limit = REFUSED[case]
    before = len(client.get("/v1/robots").json()["items"])
    answer = client.post("/v1/robots", json=body)
    assert answer.status_code == 422, answer.text
    error = answer.json()["errors"][0]
    assert error["field"] == field
    assert limit in error["limit"]
    inline = client.post("/v1/applications", json=application(body))
    assert inline.json()["errors"][0]["field"] == f"robot.{field}"
    assert len(client.get("/v1/robots").json()["items"]) == before


LAUGHS = "".join(f'<!ENTITY l{k + 1} "{f"&l{k};" * 10}">' for k in range(10))
DEEP = 100_000
RING = URDF.replace('<child link="flange"/>', '<child link="base"/>')
HOSTILE = {
    "billion laughs": f'<!DOCTYPE robot [<!ENTITY l0 "ha">{LAUGHS}]><robot name="&l10;"/>',
    "external entity": '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="&x;"/>',
    "external document type": '<!DOCTYPE robot SYSTEM "http://127.0.0.1:1/robot.dtd"><robot name="r"/>',
    "deep nesting": "<robot>" + "<link>" * DEEP + "</link>" * DEEP + "</robot>",
    "many links": '<robot name="r">' + "".join(f'<link name="l{k}"/>' for k in range(20_000)) + "</robot>",
    "many attributes": "<robot " + " ".join(f'a{k}="1"' for k in range(20_000)) + "/>",
    "huge numbers": URDF.replace('"0.30 0 0"', '"1e999 0 0"'),
    "digits": URDF.replace('"0.30 0 0"', '"' + "9" * 100_000 + ' 0 0"'),
    "many numbers": URDF.replace('"0.30 0 0"', '"' + "1 " * 100_000 + '"'),
    "NaN": URDF.replace('mass value="3.0"', 'mass value="nan"'),
    "ring": RING,
    "another encoding": '<?xml version="1.0" encoding="utf-16"?>' + URDF.partition("?>")[2],
    "encoding of no name": '<?xml version="1.0" encoding="nil"?>' + URDF.partition("?>")[2],
    "lone surrogate": URDF.replace("my_arm", "\ud800"),
    "too long": "<robot>" + " " * 1_100_000 + "</robot>",
}


@pytest.mark.parametrize("case", HOSTILE, ids=str)
def test_hostile_texts_are_refused_quickly(client: TestClient, case: str) -> None:
    began = time.process_time()
    body = json.dumps({"urdf": HOSTILE[case], **SETTINGS, "tip_link": "flange"})
    answer = client.post("/v1/robots", content=body, headers={"content-type": "application/json"})
    assert 400 <= answer.status_code < 500, answer.text
    assert time.process_time() - began < LONGEST_ANSWER_S


def pieces() -> st.SearchStrategy[str]:
    """What replaces a piece of a good URDF."""
    words = ["nan", "inf", "-1", "1e308", "", "base", "elbow", "<", ">", '"', "&amp;", "&x;", "<link/>", "\x00", "0 0"]
    words += ["prismatic", "floating", "<mimic joint='yaw'/>", "</robot>", "<!--", "é", "１"]
    return st.sampled_from(words) | st.text(max_size=20) | st.floats().map(str)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_spoilt_urdfs_are_accepted_or_refused(client: TestClient, data: st.DataObject) -> None:
    text = URDF
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(text)))
        end = data.draw(st.integers(start, min(len(text), start + 60)))
        text = text[:start] + data.draw(pieces()) + text[end:]
    answer = client.post("/v1/robots", json={"urdf": text, **SETTINGS})
    assert answer.status_code in (201, 422), answer.text


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(field=st.sampled_from(sorted(preset_wire("ur5"))), value=st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5), lambda x: st.lists(x, max_size=6)
))  # fmt: skip
def test_spoilt_robots_are_accepted_or_refused(client: TestClient, field: str, value: Any) -> None:
    body = json.dumps(preset_wire("ur5") | {field: value})
    answer = client.post("/v1/robots", content=body, headers={"content-type": "application/json"})
    assert answer.status_code in (201, 422), answer.text
