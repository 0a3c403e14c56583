"""API keys: nothing without one, and nothing of anybody else's, on every route that the interface describes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import Engine, select, text

from api.app import create_app
from armature import Client
from services.jobs.keys import create_key, list_keys, revoke_key
from services.jobs.owners import OWNED
from shared.db.engine import reading, transaction
from shared.db.tables import ApiKey, BrowserSession
from shared.domain import JobState
from shared.settings import Settings
from tests.service.queue_actions import drain
from tests.service.requests import body

OPEN = {"/livez", "/readyz", "/metrics", "/v1/session"}
"""What anybody may ask."""


@pytest.fixture
def app_client(settings: Settings) -> Iterator[TestClient]:
    """The API, asking for keys."""
    with TestClient(create_app(settings.model_copy(update={"api_keys_required": True}))) as client:
        yield client


def bearer(key: str) -> dict[str, str]:
    """The header that shows a key."""
    return {"Authorization": f"Bearer {key}"}


def operations(client: TestClient) -> list[tuple[str, str]]:
    """Every method and path of the OpenAPI document."""
    paths = client.get("/v1/openapi.json").json()["paths"]
    return [(method.upper(), path) for path, methods in paths.items() for method in methods]


def of(path: str, **values: str) -> str:
    """A path with its parameters filled in; those not named are 0."""
    while "{" in path:
        before, _, rest = path.partition("{")
        name, _, after = rest.partition("}")
        path = f"{before}{values.get(name, '0')}{after}"
    return path


def submitted(client: TestClient, key: str, **changes: Any) -> str:
    """Submit; returns the id."""
    answer = client.post("/v1/applications", json=body(**changes), headers=bearer(key))
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


def test_nothing_is_answered_without_a_key(app_client: TestClient, engine: Engine) -> None:
    _, revoked = create_key(engine, "left")
    assert revoke_key(engine, "left") == 1
    for method, path in operations(app_client):
        if path in OPEN:
            continue
        for headers in ({}, bearer("armature_guess"), bearer(revoked), {"Authorization": "Basic eDp5"}):
            answer = app_client.request(method, of(path), headers=headers)
            assert answer.status_code == 401, (method, path, headers)
            assert answer.headers["content-type"] == "application/problem+json"
            assert answer.headers["www-authenticate"] == "Bearer"


def test_a_second_key_finds_nothing_of_the_first(app_client: TestClient, engine: Engine) -> None:
    (_, mine), (_, other) = create_key(engine, "mine"), create_key(engine, "other")
    application = submitted(app_client, mine)
    drain(engine)
    robot = app_client.post("/v1/robots", json=app_client.get("/v1/robots/ur5", headers=bearer(mine)).json(),
                            headers=bearer(mine)).json()["id"]  # fmt: skip
    axes = {"objective.alpha": [0.2, 0.8]}
    asked = {"name": "two", "application": body(objective={"kind": "weighted"}), "axes": axes}
    sweep = app_client.post("/v1/sweeps", json=asked, headers=bearer(mine)).json()["id"]
    named = {"application_id": application, "robot_id": robot, "sweep_id": sweep}
    assert named.keys() == OWNED.keys()
    nothing = dict.fromkeys(named, "nothing")
    tried = 0
    for method, path in operations(app_client):
        if not any(f"{{{name}}}" in path for name in named):
            assert "_id}" not in path, f"{path} names something that belongs to nobody"
            continue
        tried += 1
        answer = app_client.request(method, of(path, **named), headers=bearer(other), json={})
        assert answer.status_code == 404, (method, path, answer.text)
        unknown = app_client.request(method, of(path, **nothing), headers=bearer(other), json={})
        said, expected = answer.json()["detail"], unknown.json()["detail"]
        for value in named.values():
            said = said.replace(value, "nothing")
        assert said == expected, (method, path)
    assert tried > 15
    assert app_client.get("/v1/applications", headers=bearer(other)).json()["items"] == []
    kinds = {item["kind"] for item in app_client.get("/v1/robots", headers=bearer(other)).json()["items"]}
    assert kinds == {"preset"}
    refused = app_client.post("/v1/applications", json=body(robot=robot), headers=bearer(other))
    assert refused.status_code == 422
    # And the owner still has it all.
    assert app_client.get(f"/v1/applications/{application}/design", headers=bearer(mine)).status_code == 200
    kept = [item["id"] for item in app_client.get("/v1/applications", headers=bearer(mine)).json()["items"]]
    assert application in kept
    assert len(kept) == 3
    submitted(app_client, mine, robot=robot)


def test_two_keys_may_use_one_idempotency_key(app_client: TestClient, engine: Engine) -> None:
    (_, mine), (_, other) = create_key(engine, "mine"), create_key(engine, "other")
    ids = [
        app_client.post("/v1/applications", json=body(), headers={**bearer(key), "Idempotency-Key": "k" * 200}).json()[
            "id"
        ]
        for key in (mine, mine, other)
    ]
    assert ids[0] == ids[1] != ids[2]


def test_a_browser_logs_in_and_out(app_client: TestClient, engine: Engine) -> None:
    _, key = create_key(engine, "browser")
    assert app_client.get("/v1/session").json() == {"keys_required": True, "name": None}
    assert app_client.post("/v1/session", json={"key": "armature_guess"}).status_code == 401
    answer = app_client.post("/v1/session", json={"key": f" {key}\n"})
    assert answer.status_code == 204
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    assert key not in cookie
    assert app_client.get("/v1/session").json() == {"keys_required": True, "name": "browser"}
    assert app_client.get("/v1/applications").status_code == 200
    token = dict(app_client.cookies)
    assert app_client.delete("/v1/session").status_code == 204
    assert app_client.get("/v1/applications").status_code == 401
    app_client.cookies.update(token)  # a stolen cookie is worth nothing after the logout
    assert app_client.get("/v1/applications").status_code == 401


@pytest.mark.parametrize("end", ["revoked", "too old"])
def test_a_session_ends_with_its_key_and_its_time(app_client: TestClient, engine: Engine, end: str) -> None:
    key_id, key = create_key(engine, "browser")
    app_client.post("/v1/session", json={"key": key})
    assert app_client.get("/v1/applications").status_code == 200
    if end == "revoked":
        revoke_key(engine, key_id)
    else:
        with transaction(engine) as session:
            session.execute(text("UPDATE sessions SET expires_at = 1"))
    assert app_client.get("/v1/applications").status_code == 401


def test_only_hashes_are_kept(engine: Engine, app_client: TestClient) -> None:
    _, key = create_key(engine, "k")
    token = app_client.post("/v1/session", json={"key": key}).cookies["armature_session"]
    with reading(engine) as session:
        kept = [
            *session.execute(select(ApiKey.id, ApiKey.name, ApiKey.hash)).one(),
            *session.execute(select(BrowserSession.hash)).one(),
        ]
    assert not any(secret in value for secret in (key, token) for value in kept)
    assert len(key) >= 43  # 256 bits


def test_without_keys_nothing_is_asked(settings: Settings, engine: Engine) -> None:
    create_key(engine, "unused")
    with TestClient(create_app(settings)) as client:
        assert client.post("/v1/applications", json=body()).status_code == 202
        assert client.get("/v1/session").json() == {"keys_required": False, "name": None}


def test_revoked_keys_stay_in_the_list(engine: Engine) -> None:
    create_key(engine, "a")
    create_key(engine, "b")
    assert revoke_key(engine, "a") == 1
    assert revoke_key(engine, "a") == 0
    assert [(key.name, key.revoked_at is None) for key in list_keys(engine)] == [("a", False), ("b", True)]


def test_the_client_shows_its_key(app_client: TestClient, engine: Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    _, key = create_key(engine, "script")
    transport = app_client._transport
    with Client("http://server", api_key=key, transport=transport) as client:
        application = client.submit(body())
        assert application.cancel().state == JobState.CANCELLED
    monkeypatch.setenv("ARMATURE_API_KEY", key)
    with Client("http://server", transport=transport) as client:
        assert [item.id for item in client.applications()] == [application.id]
