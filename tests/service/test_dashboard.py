"""What the dashboard rests on: its files, YAML bodies, the overview, and the list's figures."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from api.app import create_app
from api.dashboard import STATIC
from services.codesign.motor_data import MotorData
from shared.settings import Settings
from tests.service.requests import body, grid

YAML = {"content-type": "application/yaml"}
TASKS = "tasks: {grid: {stroke: [0.2, 0.4], payload_kg: [0, 1e0]}}"


@pytest.fixture
def client(settings: Settings) -> Iterator[TestClient]:
    """The API in this process."""
    with TestClient(create_app(settings)) as client:
        yield client


def test_the_page_forbids_what_it_does_not_need(client: TestClient) -> None:
    """No inline script, nothing from elsewhere; and the API's own 404 stays."""
    page = client.get("/")
    assert page.status_code == 200
    assert "script-src 'self'" in page.headers["content-security-policy"]
    assert "unsafe" not in page.headers["content-security-policy"]
    script = client.get("/dashboard/js/main.js")
    assert script.headers["content-type"].startswith("text/javascript")
    assert script.headers["x-content-type-options"] == "nosniff"
    for missing in ("/v1/nothing", "/dashboard/nothing.js", "/dashboard/../app.py", "/dashboard/%2e%2e/app.py"):
        assert client.get(missing).status_code == 404
        assert client.get(missing).headers["content-type"] == "application/problem+json"


def test_yaml_is_as_good_as_json(client: TestClient) -> None:
    """The same application; also with anchors; and retried with its key."""
    anchored = f"name: &n two by two\n{TASKS}\ntags: [*n]\n"
    first = client.post("/v1/applications", content=anchored, headers={**YAML, "idempotency-key": "k"})
    assert first.status_code == 202
    as_json = grid(
        name="two by two", tasks={"grid": {"stroke": [0.2, 0.4], "payload_kg": [0, 1.0]}}, tags=["two by two"]
    )
    again = client.post("/v1/applications", json=as_json, headers={"idempotency-key": "k"})
    assert again.json()["id"] == first.json()["id"]


LAUGHS = "a: &a [1,1,1,1,1,1,1,1]\n" + "".join(
    f"{name}: &{name} [{','.join([f'*{before}'] * 8)}]\n" for before, name in pairwise("abcdefgh")
)
"""A few hundred bytes that would be millions of values."""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name: [x", "line"),
        ("name: x\nname: y", "'name' is given twice"),
        ("a: &a [*a]", "an alias holds itself"),
        (LAUGHS, "written out"),
        ("[" * 5000, "nest"),
        ("? [1, 2]\n: x", ""),
        ("!!python/object/apply:os.system [true]", "python/object"),
    ],
)
def test_what_is_no_yaml_is_refused(client: TestClient, text: str, said: str) -> None:
    """With a place or a reason; nothing is run, and nothing grows without end."""
    answer = client.post("/v1/applications", content=text, headers=YAML)
    assert answer.status_code == 400, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert said in answer.json()["detail"]


def test_yaml_has_the_limit_of_any_body(client: TestClient, settings: Settings) -> None:
    """A body over the limit is refused before it is read as YAML."""
    answer = client.post("/v1/applications", content="x" * (settings.max_body_bytes + 1), headers=YAML)
    assert answer.status_code == 413


def test_errors_in_yaml_name_the_field(client: TestClient) -> None:
    """As for JSON; a date is no number."""
    answer = client.post("/v1/applications", content=f"name: 2026-01-01\nalpha: .nan\n{TASKS}", headers=YAML)
    assert answer.status_code == 422
    assert {error["field"] for error in answer.json()["errors"]} == {"alpha"}


def test_overview_of_a_new_application(client: TestClient) -> None:
    """Every task with its queued co-design, and from where to follow the events."""
    path = client.post("/v1/applications", json=grid()).json()["url"]
    overview = client.get(f"{path}/overview").json()
    assert [task["outcomes"] for task in overview["tasks"]] == [
        {"own": {"state": "queued", "value": None, "reason": None}}
    ] * 4
    assert overview["unit"] == "s"
    assert overview["last_event"] == 1
    assert overview["running"] == []
    assert client.get("/v1/applications/none/overview").status_code == 404


def test_resolved_has_every_default(client: TestClient) -> None:
    """The motor in the form that a request takes, and the arm itself."""
    path = client.post("/v1/applications", json=body(motor={"voltage_limit_V": 48.0})).json()["url"]
    resolved = client.get(f"{path}/resolved").json()
    assert resolved["motor"]["voltage_limit_V"] == 48.0
    assert MotorData.from_wire(resolved["motor"]).voltage_limit == 48.0
    assert resolved["motor"]["bounds_mm"]["L"] == pytest.approx([20, 100])
    assert len(resolved["robot"]["screw_axes_space"]) == 6
    assert resolved["request"]["name"] == "three moves"


def test_the_list_says_how_far_each_is(client: TestClient) -> None:
    """Planned jobs while it goes on; those that there are at the end; names are searched in any case."""
    client.post("/v1/applications", json=grid(name="Alpha 100%", compare=["empirical"]))
    path = client.post("/v1/applications", json=grid(name="beta")).json()["url"]
    client.post(f"{path}/cancel")
    items = {item["name"]: item for item in client.get("/v1/applications").json()["items"]}
    assert (items["Alpha 100%"]["done"], items["Alpha 100%"]["total"]) == (0, 4 + 1 + 8)
    assert (items["beta"]["done"], items["beta"]["total"]) == (4, 4)
    assert items["beta"]["best"] is None
    found = client.get("/v1/applications", params={"name": "alpha 100%"}).json()["items"]
    assert [item["name"] for item in found] == ["Alpha 100%"]
    assert client.get("/v1/applications", params={"name": "%"}).json()["items"] == found


def test_what_the_first_pages_import_is_fetched_at_once() -> None:
    """Not one after the other: every module below the list and a live application has a preload, and no other."""
    scripts = STATIC / "js"
    found: set[Path] = set()

    def follow(module: Path) -> None:
        if module in found:
            return
        found.add(module)
        for name in re.findall(r'from "(\.[^"]+)"', module.read_text(encoding="utf-8")):
            follow((module.parent / name).resolve())

    for entry in ("main.js", "pages/list.js", "pages/application.js"):
        follow(scripts / entry)
    expected = {f"/dashboard/js/{module.relative_to(scripts)}" for module in found} - {"/dashboard/js/main.js"}
    page = (STATIC / "index.html").read_text(encoding="utf-8")
    assert set(re.findall(r'rel="modulepreload" href="([^"]+)"', page)) == expected


def test_no_script_reads_text_as_markup() -> None:
    """Elements are made by `dom.js`, which sets text as text; the page has no script or style of its own."""
    for script in (STATIC / "js").rglob("*.js"):
        assert not re.search(
            r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function|srcdoc|DOMParser",
            script.read_text(encoding="utf-8"),
        ), script
    page = (STATIC / "index.html").read_text(encoding="utf-8")
    assert not re.search(r"<style|\sstyle=|\son\w+=|<script>", page)
    assert not re.search(r"https?://", page)
