"""Limits: each refusal names the field, the value and the limit, and says when to come again."""

from __future__ import annotations

from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import Engine

from api.app import create_app
from services.jobs.keys import create_key
from shared.settings import Settings
from tests.service.queue_actions import drain
from tests.service.requests import body
from tests.service.test_keys import bearer


def client_of(settings: Settings, **limits: Any) -> TestClient:
    """The API with some limits."""
    return TestClient(create_app(settings.model_copy(update=limits)))


def test_queued_work_is_limited_for_each_key(settings: Settings, engine: Engine) -> None:
    (_, mine), (_, other) = create_key(engine, "mine"), create_key(engine, "other")
    with client_of(settings, api_keys_required=True, max_queued_jobs=7) as client:
        for _ in range(2):
            assert client.post("/v1/applications", json=body(), headers=bearer(mine)).status_code == 202
        full = client.post("/v1/applications", json=body(), headers=bearer(mine))
        assert full.status_code == 429
        assert int(full.headers["retry-after"]) > 0
        (error,) = full.json()["errors"]
        assert (error["field"], error["value"]) == ("tasks", 3)
        assert "6 jobs wait or run already, and at most 7" in error["limit"]
        assert client.post("/v1/applications", json=body(), headers=bearer(other)).status_code == 202
        drain(engine)
        assert client.post("/v1/applications", json=body(), headers=bearer(mine)).status_code == 202


def test_a_repeated_submission_is_answered_however_full_the_queue_is(settings: Settings) -> None:
    with client_of(settings, max_queued_jobs=3) as client:
        answers = [client.post("/v1/applications", json=body(), headers={"Idempotency-Key": "k"}) for _ in range(2)]
        assert [answer.status_code for answer in answers] == [202, 202]
        assert client.post("/v1/applications", json=body()).status_code == 429


def test_points_of_a_trajectory(settings: Settings) -> None:
    with client_of(settings, max_points=100) as client:
        fits = body(transcription={"degree": 2, "intervals": 50})
        assert client.post("/v1/applications", json=fits).status_code == 202
        answer = client.post("/v1/applications", json=body(transcription={"degree": 2, "intervals": 51}))
        assert answer.status_code == 422
        (error,) = answer.json()["errors"]
        assert (error["field"], error["value"]) == ("transcription.intervals", 51)
        assert "at most 100" in error["limit"]


def test_the_rate_of_one_address_is_limited_and_health_is_not(settings: Settings) -> None:
    with client_of(settings, rate_per_minute=5) as client:
        answers = [client.get("/v1/applications") for _ in range(6)]
        assert [answer.status_code for answer in answers] == [200] * 5 + [429]
        assert 1 <= int(answers[-1].headers["retry-after"]) <= 120
        assert answers[-1].headers["content-type"] == "application/problem+json"
        assert answers[-1].json()["errors"][0]["field"] == "requests"
        assert client.get("/livez").status_code == 200


def test_the_rate_of_one_key_does_not_touch_another(settings: Settings, engine: Engine) -> None:
    (_, mine), (_, other) = create_key(engine, "mine"), create_key(engine, "other")
    with client_of(settings, api_keys_required=True, rate_per_minute=2) as client:
        codes = [client.get("/v1/applications", headers=bearer(mine)).status_code for _ in range(3)]
        assert codes == [200, 200, 429]
        assert client.get("/v1/applications", headers=bearer(other)).status_code == 200


@pytest.mark.parametrize("path", ["/v1/session", "/v1/applications"])
def test_no_limit(settings: Settings, path: str) -> None:
    with client_of(settings, rate_per_minute=0) as client:
        assert {client.get(path).status_code for _ in range(50)} == {200}
