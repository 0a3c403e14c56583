"""A page of another site gets nothing done through a visitor's browser, with keys and without."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import Engine

from api.app import create_app
from services.jobs.keys import create_key
from shared.settings import Settings
from tests.service.requests import body
from tests.service.test_keys import bearer

ELSEWHERE = (
    {"Sec-Fetch-Site": "cross-site", "Origin": "http://testserver"},
    {"Sec-Fetch-Site": "same-site"},
    {"Origin": "http://evil.example"},
    {"Origin": "http://testserver:81"},
    {"Origin": "null"},
)
HERE = ({"Sec-Fetch-Site": "same-origin"}, {"Sec-Fetch-Site": "none"}, {"Origin": "http://testserver"}, {})


@pytest.fixture
def client(settings: Settings, engine: Engine) -> Iterator[TestClient]:
    """The API, asking for keys, and a browser's session with it."""
    _, key = create_key(engine, "browser")
    with TestClient(create_app(settings.model_copy(update={"api_keys_required": True}))) as client:
        assert client.post("/v1/session", json={"key": key}).status_code == 204
        yield client


@pytest.mark.parametrize("headers", ELSEWHERE)
def test_from_elsewhere(client: TestClient, headers: dict[str, str]) -> None:
    submitted = client.post("/v1/applications", json=body(), headers=headers)
    assert submitted.status_code == 403
    assert submitted.headers["content-type"] == "application/problem+json"
    for method, path in (("DELETE", "/v1/session"), ("POST", "/v1/applications/x/cancel"), ("DELETE", "/v1/robots/x")):
        assert client.request(method, path, headers=headers).status_code == 403, path
    assert client.post("/v1/session", json={"key": "another's"}, headers=headers).status_code == 403
    listed = client.get("/v1/applications", headers=headers)  # reading is up to the browser, which lets no page read
    assert listed.json()["items"] == []
    assert "access-control-allow-origin" not in listed.headers


@pytest.mark.parametrize("headers", HERE)
def test_from_here(client: TestClient, headers: dict[str, str]) -> None:
    assert client.post("/v1/applications", json=body(), headers=headers).status_code == 202


def test_a_key_in_the_header_is_asked_nothing_more(settings: Settings, engine: Engine) -> None:
    _, key = create_key(engine, "script")
    with TestClient(create_app(settings.model_copy(update={"api_keys_required": True}))) as client:
        headers = {**bearer(key), **ELSEWHERE[0]}
        assert client.post("/v1/applications", json=body(), headers=headers).status_code == 202


def test_without_keys_other_sites_are_kept_out_too(settings: Settings) -> None:
    with TestClient(create_app(settings)) as client:
        assert client.post("/v1/applications", json=body(), headers=ELSEWHERE[0]).status_code == 403
        form = client.post("/v1/applications", data={"name": "x"})
        assert form.status_code == 415
        assert "application/x-www-form-urlencoded" in form.json()["detail"]
