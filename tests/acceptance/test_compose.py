"""docker-compose.yml cannot drift from what works: each service's own command runs, read from the file.

There is no Docker here: commands run on this machine, with the file's host names and folders replaced.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
import yaml

from tests.conftest import home_with_kernels
from tests.servers import Server, free_port, postgres_database
from tests.service.requests import HOME

COMPOSE = yaml.safe_load((Path(__file__).parents[2] / "docker-compose.yml").read_text())
SERVICES: dict[str, dict[str, Any]] = COMPOSE["services"]
OURS = ("migrate", "api", "relay", "worker")
TIMEOUT_S = 90.0


@contextmanager
def running(command: list[str], environment: Mapping[str, str]) -> Iterator[subprocess.Popen[bytes]]:
    """One of our processes, asked to end at the end."""
    process = subprocess.Popen(command, env={**os.environ, **environment})
    try:
        yield process
    finally:
        process.terminate()
        process.wait(TIMEOUT_S)


def test_each_command_of_the_compose_file(postgres: Server, redis: Server, tmp_path: Path) -> None:
    port = str(free_port())
    with postgres_database(postgres) as database_url, ExitStack() as stack:
        replaced = {"ARMATURE_DATABASE_URL": database_url, "ARMATURE_BROKER_URL": redis.url}
        home = home_with_kernels(tmp_path / "home")

        def command(name: str) -> list[str]:
            words = {"python": sys.executable, "0.0.0.0": "127.0.0.1", "8000": port}
            return [words.get(word, word) for word in SERVICES[name]["command"]]

        def environment(name: str) -> dict[str, str]:
            given = SERVICES[name]["environment"]
            assert set(replaced) <= set(given)
            return {**given, **replaced, "ARMATURE_HOME": str(home), "ARMATURE_WORKERS": "1"}

        subprocess.run(command("migrate"), env={**os.environ, **environment("migrate")}, check=True, timeout=TIMEOUT_S)
        for name in OURS[1:]:
            stack.enter_context(running(command(name), environment(name)))
        http = stack.enter_context(httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=TIMEOUT_S))
        wait_until(lambda: http.get("/readyz").status_code == 200)
        task = {"start_rad": [0.2] * 6, "end_rad": HOME}
        submitted = http.post(
            "/v1/applications", json={"name": "one", "tasks": [task], "transcription": {"intervals": 20}}
        )
        path = submitted.headers["location"]
        check = [sys.executable, *SERVICES["worker"]["healthcheck"]["test"][2:]]
        of_worker = {**os.environ, **environment("worker")}
        wait_until(lambda: subprocess.run(check, env=of_worker, check=False).returncode == 0)
        wait_until(lambda: http.get(path).json()["state"] == "succeeded")


def wait_until(holds: Any) -> None:
    """Poll."""
    deadline = time.monotonic() + TIMEOUT_S
    while True:
        try:
            if holds():
                return
        except httpx.TransportError:
            pass
        assert time.monotonic() < deadline
        time.sleep(0.1)


def test_the_order_of_the_compose_file() -> None:
    for name in ("api", "relay", "worker"):
        needs = SERVICES[name]["depends_on"]
        assert needs["migrate"]["condition"] == "service_completed_successfully"
        assert needs["redis"]["condition"] == "service_healthy"
    assert SERVICES["migrate"]["depends_on"]["postgres"]["condition"] == "service_healthy"


@pytest.mark.parametrize("option", ["--appendonly yes", "--maxmemory-policy noeviction"])
def test_redis_keeps_its_queue(option: str) -> None:
    assert option in " ".join(SERVICES["redis"]["command"])
