"""What Prometheus reads, read by its own parser."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families
from sqlalchemy import Engine

from api.app import create_app
from services.jobs.cancel import delete_application
from services.jobs.claim import release
from services.jobs.submit import submit
from services.jobs.sweep import sweep
from services.jobs.tally import tally
from services.jobs.workers import say_goodbye, sign_of_life
from shared.settings import Settings
from tests.service.queue_actions import EXPIRED_LEASE_S, drain, take
from tests.service.requests import application


@pytest.fixture
def client(settings: Settings) -> Iterator[TestClient]:
    """The API in this process."""
    with TestClient(create_app(settings)) as client:
        yield client


Scraped = dict[tuple[str, tuple[tuple[str, str], ...]], float]


def scrape(client: TestClient) -> Scraped:
    """Every sample by name and labels."""
    families = text_string_to_metric_families(client.get("/metrics").text)
    return {(s.name, tuple(sorted(s.labels.items()))): s.value for family in families for s in family.samples}


def test_the_queue_and_its_history(client: TestClient, engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    before = scrape(client)
    assert before["armature_jobs", (("state", "queued"),)] == 3
    assert before["armature_oldest_queued_age_seconds", ()] >= 0
    take(engine, EXPIRED_LEASE_S)
    assert sweep(engine, max_attempts=3) == 1
    release(engine, take(engine))
    drain(engine, failing=frozenset({1}))
    assert tally(engine, settled_s=60.0) == 0  # too young
    assert tally(engine, settled_s=-1.0) > 0
    assert tally(engine, settled_s=-1.0) == 0  # each once
    after = scrape(client)
    assert after["armature_jobs", (("state", "queued"),)] == 0
    assert after["armature_lease_expiries_total", ()] == 1  # not the job that was given back
    assert after["armature_claims_total", ()] == 3 + 1 + 2 + 2
    assert after["armature_jobs_finished_total", (("state", "succeeded"),)] == 5
    assert after["armature_jobs_finished_total", (("state", "failed"),)] == 1
    assert after["armature_solve_seconds_count", ()] == 4  # 2 co-designs, 2 motions of 0.1 s
    assert after["armature_solve_seconds_sum", ()] == pytest.approx(0.4)
    assert after["armature_solve_seconds_bucket", (("le", "0.1"),)] == 4
    assert delete_application(engine, application_id)
    later = scrape(client)
    assert all(later[key] >= value for key, value in after.items() if key[0].endswith(("_total", "_count", "_bucket")))


def test_a_job_that_died(client: TestClient, engine: Engine, settings: Settings) -> None:
    submit(engine, settings, application())
    for _ in range(3):
        take(engine, EXPIRED_LEASE_S)
        sweep(engine, max_attempts=1)
    tally(engine, settled_s=-1.0)
    found = scrape(client)
    assert found["armature_jobs_finished_total", (("state", "dead"),)] == 3
    assert found["armature_lease_expiries_total", ()] == 3


def test_requests_by_route_and_status(client: TestClient) -> None:
    for _ in range(2):
        client.get("/v1/applications/nothing/design")
    client.post("/v1/applications", content="name: [", headers={"content-type": "application/yaml"})
    client.post("/v1/applications", content="name: x", headers={"content-type": "application/yaml"})
    client.get("/made/up")
    found = scrape(client)

    def requests(method: str, route: str, status: str) -> float:
        return found["armature_http_requests_total", (("method", method), ("route", route), ("status", status))]

    assert requests("GET", "/v1/applications/{application_id}/design", "404") == 2
    assert requests("POST", "/v1/applications", "422") == 1
    assert requests("POST", "none", "400") == 1
    assert requests("GET", "none", "404") == 1
    place = (("method", "GET"), ("route", "/v1/applications/{application_id}/design"))
    assert found["armature_http_request_seconds_count", place] == 2


def test_workers_seen_lately(client: TestClient, engine: Engine) -> None:
    sign_of_life(engine, "a:1", "a", 4)
    sign_of_life(engine, "b:1", "b", 2)
    sign_of_life(engine, "a:1", "a", 4)
    assert scrape(client)["armature_worker_processes", ()] == 6
    say_goodbye(engine, "b:1")
    found = scrape(client)
    assert (found["armature_workers", ()], found["armature_worker_processes", ()]) == (1, 4)
