"""The whole service as people meet it: real processes, over the embedded pair and over Postgres and Redis."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from typing import Any

import httpx
import numpy as np
import pytest
from sqlalchemy import select

from armature.processes import Place, Service, running_service
from shared.db.engine import make_engine, reading
from shared.db.tables import Job, JobTransition
from shared.domain import JobState
from shared.settings import Settings
from tests.conftest import home_with_kernels
from tests.servers import descendants, postgres_database
from tests.service.requests import HOME

QUICK = {"scheme": "radau", "degree": 1, "intervals": 20, "control": "voltage"}
"""The paper's transcription on a coarse grid: nothing here depends on accuracy."""
LONG = {**QUICK, "intervals": 120}

FINISH_TIMEOUT_S = 120.0
SHORT_LEASE = {"lease_s": 3.0, "heartbeat_s": 0.5, "cancel_poll_s": 0.2, "sweep_s": 0.5, "resend_after_s": 3.0}


def move(stroke: float, **changes: Any) -> dict[str, Any]:
    """One task of the paper's kind."""
    return {"name": f"{stroke} rad", "start_rad": [stroke] * 6, "end_rad": HOME, **changes}


@pytest.fixture(scope="module", params=["embedded", "postgres and redis"])
def settings(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Settings]:
    """Settings of each pair in turn, with short leases."""
    home = home_with_kernels(tmp_path_factory.mktemp("service") / "home")
    if request.param == "embedded":
        yield Settings(home=home, **SHORT_LEASE)
        return
    redis = request.getfixturevalue("redis")
    with postgres_database(request.getfixturevalue("postgres")) as url:
        yield Settings(home=home, database_url=url, broker_url=redis.url, **SHORT_LEASE)


@pytest.fixture(scope="module")
def service(settings: Settings) -> Iterator[Service]:
    """The service, running."""
    with pytest.MonkeyPatch.context() as environment:
        for name, value in SHORT_LEASE.items():
            environment.setenv(f"ARMATURE_{name.upper()}", str(value))
        with running_service(settings, Place(workers=2)) as service:
            yield service


@pytest.fixture
def http(service: Service) -> Iterator[httpx.Client]:
    """A client of it."""
    with httpx.Client(base_url=service.url, timeout=30.0) as client:
        yield client


def submit(http: httpx.Client, **body: Any) -> str:
    """Submit; returns the application's path."""
    answer = http.post("/v1/applications", json=body)
    assert answer.status_code == 202, answer.text
    return str(answer.headers["location"])


def wait(http: httpx.Client, path: str) -> dict[str, Any]:
    """Poll until the application is final."""
    deadline = time.monotonic() + FINISH_TIMEOUT_S
    while time.monotonic() < deadline:
        status: dict[str, Any] = http.get(path).json()
        if status["state"] not in ("queued", "running"):
            return status
        time.sleep(0.1)
    raise AssertionError(f"not final after {FINISH_TIMEOUT_S} s: {status}")


def wait_for_running(http: httpx.Client, path: str) -> None:
    """Poll until a job of the first stage runs."""
    deadline = time.monotonic() + FINISH_TIMEOUT_S
    while http.get(path).json()["progress"]["stages"][0]["running"] == 0:
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_an_application_from_submission_to_design(http: httpx.Client) -> None:
    """Two good tasks, one too fast for the rotors, one too heavy: the good ones get a design, the others a reason."""
    path = submit(
        http,
        name="four moves",
        objective={"kind": "energy"},
        transcription=QUICK,
        compare=["empirical", "worst_case"],
        empirical_task=0,
        worst_case_task="0.6 rad",
        tasks=[
            move(0.4, payload_kg=1.0, duration_s=1.0),
            move(0.6, payload_kg=2.0, duration_s=1.0),
            move(1.0, name="too fast", duration_s=0.2),
            move(0.4, name="too heavy", payload_kg=400.0, duration_s=2.0),
        ],
    )
    status = wait(http, path)
    assert status["state"] == "completed_with_failures", status
    reasons = {task["name"]: task["reason"] for task in status["excluded_tasks"]}
    assert set(reasons) == {"too fast", "too heavy"}
    assert "0.318" in reasons["too fast"]
    assert "rotor" in reasons["too fast"]
    assert "N m" in reasons["too heavy"]
    assert "joint 2" in reasons["too heavy"]

    comparison = http.get(f"{path}/comparison").json()
    assert comparison["tasks_compared"] == [0, 1]
    assert set(comparison["methods"]) == {"own", "two_step", "empirical", "worst_case"}
    assert comparison["regret"]["empirical"]["per_task"][0] == pytest.approx(0, abs=1e-3)  # its own task
    assert comparison["regret"]["worst_case"]["per_task"][1] == pytest.approx(0, abs=1e-3)
    assert all(method["total"] > -1e-3 for method in comparison["regret"].values())

    designs = http.get(f"{path}/designs").json()
    own = np.array([task["design_mm"] for task in designs["tasks"]])
    np.testing.assert_allclose(designs["mean"]["design_mm"], own.mean(axis=0), rtol=1e-12)
    np.testing.assert_array_equal(designs["methods"]["empirical"]["design_mm"], own[0])

    design = http.get(f"{path}/design").json()
    assert [motor["joint"] for motor in design["motors"]] == [1, 2, 3, 4, 5, 6]
    for motor in design["motors"]:
        assert min(entry["slack"] for entry in motor["constraints"].values()) > -1e-6

    trajectory = http.get(f"{path}/tasks/1/trajectory").json()
    assert trajectory["joint_position_rad"][0] == pytest.approx([0.6] * 6)
    assert trajectory["joint_position_rad"][-1] == pytest.approx([0.0] * 6, abs=1e-6)
    assert trajectory["time_s"][-1] == pytest.approx(1.0)
    assert np.abs(trajectory["current_q_A"]).max() <= 3.0 + 1e-6
    rows = http.get(f"{path}/tasks/1/trajectory", headers={"accept": "text/csv"}).text.splitlines()
    assert len(rows) == 1 + len(trajectory["time_s"])
    assert len(rows[0].split(",")) == 1 + 7 * 6
    assert http.get(f"{path}/tasks/2/trajectory").status_code == 404
    log = http.get(f"{path}/tasks/1/log", params={"method": "own"}).json()
    assert [line["iteration"] for line in log["iterations"]] == list(range(len(log["iterations"])))
    assert http.get(f"{path}/tasks/3/log", params={"method": "own"}).json()["reason"] == reasons["too heavy"]


def test_cancel_stops_the_running_solves(http: httpx.Client) -> None:
    tasks = [move(0.1 * k, name=f"{k}", payload_kg=1.0) for k in range(1, 9)]
    path = submit(http, name="long", transcription=LONG, tasks=tasks)
    wait_for_running(http, path)
    began = time.monotonic()
    http.post(f"{path}/cancel").raise_for_status()
    status = wait(http, path)
    assert status["state"] == "cancelled"
    assert time.monotonic() - began < 5.0
    assert status["progress"]["stages"][0]["cancelled"] > 0


def test_a_killed_solver_process_loses_nothing(http: httpx.Client, service: Service, settings: Settings) -> None:
    """SIGKILL in mid-solve: the job's lease runs out, and it is done again, once."""
    tasks = [move(0.1 * k, name=f"{k}", payload_kg=1.0) for k in (1, 2)]
    path = submit(http, name="victim", transcription=LONG, tasks=tasks)
    application_id = path.rsplit("/", 1)[1]
    wait_for_running(http, path)
    engine = make_engine(settings.database_url)
    try:
        with reading(engine) as session:
            running = select(Job.worker).where(Job.application_id == application_id, Job.state == JobState.RUNNING)
            worker = session.scalars(running).first()
        assert worker is not None
        child = int(worker.rsplit(":", 1)[1])
        assert child in descendants(service.pids["worker"])
        os.kill(child, signal.SIGKILL)
        assert wait(http, path)["state"] == "succeeded"
        with reading(engine) as session:
            done = (JobTransition.application_id == application_id, JobTransition.to_state == JobState.SUCCEEDED)
            ends = list(session.scalars(select(JobTransition.job_id).where(*done)))
            attempts = list(session.scalars(select(Job.attempts).where(Job.application_id == application_id)))
        assert len(ends) == len(set(ends)) == 5
        assert sorted(attempts)[-1] == 2
    finally:
        engine.dispose()


def test_health(http: httpx.Client) -> None:
    assert http.get("/livez").json() == {"status": "alive"}
    ready = http.get("/readyz")
    assert ready.status_code == 200
    assert ready.json()["queued_jobs"] == 0
    assert 'armature_jobs{state="queued"} 0.0' in http.get("/metrics").text
