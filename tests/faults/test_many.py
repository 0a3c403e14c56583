"""Fifty clients at once: one application for one key, and a thousand times more jobs than workers."""

from __future__ import annotations

import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from itertools import cycle

import httpx
from sqlalchemy import func, select

from shared.db.engine import reading
from shared.db.tables import Application, Job
from shared.domain import ApplicationState
from tests.faults.conftest import Count, Measured
from tests.faults.history import assert_true_to_its_word, attempts
from tests.faults.service import Service, moves, percentile_95

CLIENTS = 50
DONE_IN_S = 1200.0
LOOK_EVERY_S = 0.5
"""As a dashboard does."""
NO_LEASE_LOST = {"ARMATURE_LEASE_S": "30"}


def test_many_jobs_queued_by_fifty_clients_at_once(
    service_of_production: Service, count: Count, measured: Measured
) -> None:
    """Nothing is lost and nothing is done twice, through every stage; somebody asks for states all the while."""
    service, applications, tasks = service_of_production, count("applications at once"), count("tasks of each")
    http = service.start_api(ARMATURE_MAX_QUEUED_JOBS=str(applications * tasks))
    service.start("relay")
    body = moves(tasks).model_dump(mode="json", exclude_unset=True)
    waited: list[float] = []

    def submit(_: int) -> str:
        asked = time.monotonic()
        answer = http.post("/v1/applications", json=body)
        waited.append(time.monotonic() - asked)
        assert answer.status_code == 202, answer.text
        return str(answer.json()["id"])

    began = time.monotonic()
    with ThreadPoolExecutor(CLIENTS) as clients:
        service.accepted += clients.map(submit, range(applications))
    queued_s = time.monotonic() - began
    service.start("worker")
    looks = _look_until_the_end(service, http)
    done_s = time.monotonic() - began - queued_s
    with reading(service.engine) as session:
        assert session.scalar(select(func.count()).select_from(Job)) == applications * (2 * tasks + 1)
        assert set(session.scalars(select(Application.state))) == {ApplicationState.SUCCEEDED}
    assert set(Counter(service.executions()).values()) == {applications}
    assert attempts(service.engine) == {1}
    assert_true_to_its_word(service.engine, service.accepted)
    measured(f"{applications * tasks} jobs queued in {queued_s:.0f} s, with all that follows done {done_s:.0f} s later")
    measured(f"95 of 100 submissions by {CLIENTS} clients at once within {percentile_95(waited):.2f} s")
    measured(f"95 of 100 looks at a state within {1e3 * percentile_95(looks):.0f} ms, the workers busy")


def _look_until_the_end(service: Service, http: httpx.Client) -> list[float]:
    """Ask for the state of one application after the other; returns how long each answer took [s]."""
    took: list[float] = []
    every_one = cycle(service.accepted)
    deadline = time.monotonic() + DONE_IN_S
    while service.unfinished():
        assert time.monotonic() < deadline, f"not within {DONE_IN_S:g} s"
        asked = time.monotonic()
        assert http.get(f"/v1/applications/{next(every_one)}").status_code == 200
        took.append(time.monotonic() - asked)
        time.sleep(LOOK_EVERY_S)
    return took


def test_fifty_clients_with_one_key(service: Service) -> None:
    """They get one application between them, and it runs once."""
    http = service.start_api()
    body = moves().model_dump(mode="json", exclude_unset=True)

    def submit(_: int) -> httpx.Response:
        return http.post("/v1/applications", json=body, headers={"Idempotency-Key": "the same"})

    with ThreadPoolExecutor(CLIENTS) as clients:
        answers = list(clients.map(submit, range(CLIENTS)))
    assert {answer.status_code for answer in answers} == {202}
    (application_id,) = {answer.json()["id"] for answer in answers}
    service.accepted.append(application_id)
    service.start("relay")
    service.start("worker", **NO_LEASE_LOST)
    service.wait_for_the_end()
    assert len(service.executions()) == 7
    assert_true_to_its_word(service.engine, service.accepted)
