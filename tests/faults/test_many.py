"""Fifty clients at once: one application for one key, and a thousand times more jobs than workers."""

from __future__ import annotations

import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import httpx
from sqlalchemy import func, select

from shared.db.engine import reading
from shared.db.tables import Application, Job
from shared.domain import ApplicationState
from tests.faults.conftest import Count, Measured
from tests.faults.history import assert_true_to_its_word, attempts
from tests.faults.service import Service, moves

CLIENTS = 50
DONE_IN_S = 600.0
NO_LEASE_LOST = {"ARMATURE_LEASE_S": "30"}


def test_many_jobs_queued_by_fifty_clients_at_once(service: Service, count: Count, measured: Measured) -> None:
    """Nothing is lost and nothing is done twice, through every stage."""
    applications, tasks = count("applications at once"), count("tasks of each")
    http = service.start_api(ARMATURE_MAX_QUEUED_JOBS=str(applications * tasks))
    service.start("relay")
    body = moves(tasks).model_dump(mode="json", exclude_unset=True)

    def submit(_: int) -> str:
        answer = http.post("/v1/applications", json=body)
        assert answer.status_code == 202, answer.text
        return str(answer.json()["id"])

    began = time.monotonic()
    with ThreadPoolExecutor(CLIENTS) as clients:
        service.accepted += clients.map(submit, range(applications))
    queued_s = time.monotonic() - began
    service.start("worker", **NO_LEASE_LOST)
    service.wait_for_the_end(DONE_IN_S)
    done_s = time.monotonic() - began - queued_s
    with reading(service.engine) as session:
        assert session.scalar(select(func.count()).select_from(Job)) == applications * (2 * tasks + 1)
        assert set(session.scalars(select(Application.state))) == {ApplicationState.SUCCEEDED}
    assert set(Counter(service.executions()).values()) == {applications}
    assert attempts(service.engine) == {1}
    assert_true_to_its_word(service.engine, service.accepted)
    measured(f"{applications * tasks} jobs queued in {queued_s:.0f} s, with all that follows done {done_s:.0f} s later")


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
