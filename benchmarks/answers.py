"""How soon the API answers fifty clients at once, while the workers and the relay want the processors too."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import numpy as np

from benchmarks.queue_processes import body, run_api, run_relay, run_worker, running, wait_for
from shared.domain import ApplicationState
from shared.settings import Settings
from tests.servers import free_port

CLIENTS = 50
CONNECTIONS = httpx.Limits(max_connections=CLIENTS, max_keepalive_connections=CLIENTS)
JSON = {"Content-Type": "application/json"}
ASK_EVERY_S = 1.0
WATCH_S = 20.0
START_S = 60.0


def latencies(settings: Settings, applications: int, tasks: int) -> dict[str, dict[str, float]]:
    """Seconds that each submission and each question for a state took, asked by fifty clients at once.

    The clients are threads of this process, each with a connection of its own; what they send is written before.
    """
    port = str(free_port())
    sent = json.dumps(body(tasks)).encode()
    asked: dict[str, list[float]] = {"submit": [], "status": []}

    def timed(what: str, ask: Callable[[], httpx.Response]) -> dict[str, Any]:
        began = time.perf_counter()
        answer = ask()
        asked[what].append(time.perf_counter() - began)
        answer.raise_for_status()
        result: dict[str, Any] = answer.json()
        return result

    def use(_: int) -> list[str]:
        answers = [
            timed("submit", lambda: http.post("/v1/applications", content=sent, headers=JSON))
            for _ in range(applications // CLIENTS)
        ]
        return [str(answer["id"]) for answer in answers]

    def watch(mine: list[str]) -> None:
        for application_id in mine:
            state = ApplicationState.QUEUED
            while not state.final and time.perf_counter() < until:
                answer = timed("status", lambda: http.get(f"/v1/applications/{application_id}"))  # noqa: B023
                state = ApplicationState(answer["state"])
                time.sleep(ASK_EVERY_S)

    with (
        running(settings, run_api, run_relay, run_worker, BENCHMARK_PORT=port),
        ThreadPoolExecutor(CLIENTS) as clients,
        httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=START_S, limits=CONNECTIONS) as http,
    ):
        wait_for(lambda: _up(port))
        ours = list(clients.map(use, range(CLIENTS)))
        until = time.perf_counter() + WATCH_S
        list(clients.map(watch, ours))
    return {what: figures(seconds) for what, seconds in asked.items()}


def figures(seconds: list[float]) -> dict[str, float]:
    """What is kept of many durations."""
    median, most_of_them, most = (float(np.quantile(seconds, q)) for q in (0.5, 0.95, 1.0))
    return {"count": len(seconds), "median_s": median, "p95_s": most_of_them, "most_s": most}


def _up(port: str) -> bool:
    try:
        return httpx.get(f"http://127.0.0.1:{port}/readyz").is_success
    except httpx.TransportError:
        return False
