"""How many jobs a second go through the whole path, beside bare Celery tasks; and how soon the API answers meanwhile.

    python -m benchmarks.throughput [--rounds 3] [--applications 40] [--tasks 100] [--workers 2]

Postgres with fsync on and Redis from `tests/servers.py`, all on this machine. A job's solve is a stand-in that computes
nothing; everything else is what a worker does: message, claim, inputs, finish, next stage, next message. Bare tasks do
nothing at all: their queue is filled first, and only its draining is timed. Both in turn, on the same broker, with the
same number of processes; the ratio is that of the medians.

Then fifty clients submit a hundred applications of a hundred tasks at once through one API process, while the same
workers go through them, and each asks for the state of its applications once a second for forty seconds; on Postgres
and Redis, then on SQLite and the embedded broker.

Results: benchmarks/results/throughput.json, and a table in docs/performance.md.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from celery import shared_task
from sqlalchemy import Engine, func, select

from benchmarks.tables import put, table
from services.jobs.finish import Outcome
from services.jobs.submit import submit
from services.jobs.work import Work
from shared.contracts.application import ApplicationRequest
from shared.db.engine import make_engine, reading
from shared.db.migrate import upgrade
from shared.db.tables import Application, Job
from shared.dispatch.broker import celery_app, queue_size, send, worker_arguments
from shared.domain import ApplicationState, JobState, Stage
from shared.settings import Settings
from tests.servers import free_port, postgres_database, postgres_server, redis_server

RESULTS = Path(__file__).parent / "results" / "throughput.json"
BARE_QUEUE, BARE_TASK = "bare", "benchmark.bare"
CLIENTS = 50
CONNECTIONS = httpx.Limits(max_connections=CLIENTS, max_keepalive_connections=CLIENTS)
JSON = {"Content-Type": "application/json"}
ASK_EVERY_S = 1.0
WATCH_S = 40.0
LOOK_EVERY_S = 0.02
START_S = 60.0

PROCESSES = multiprocessing.get_context("forkserver")
PROCESSES.set_forkserver_preload(["__main__", "api.main", "worker.main", "worker.relay"])
"""Forked from a process that has imported everything: what is measured begins sooner."""

ABUNDANT: dict[str, Any] = {"max_queued_jobs": 10**6, "rate_per_minute": 0}
"""Limits that stand in nobody's way."""

SUMMARY = {"objective": 1.0, "final_time_s": 1.0, "solver_status": "Solve_Succeeded", "solve_time_s": 0.0}
DESIGN = {"design_mm": [[30.0, 20.0, 40.0, 2.0, 6.0, 7.0, 2.0]] * 6}


@shared_task(name=BARE_TASK)  # type: ignore[untyped-decorator]
def bare(_: int) -> None:
    """Nothing."""


def no_solve(work: Work, *_: Any) -> Outcome:
    """In place of `services.jobs.execute.execute`."""
    if work.spec.stage == Stage.RECONCILE:
        return Outcome(JobState.SUCCEEDED, summary={"methods": ["two_step"]}, designs={"two_step": DESIGN})
    return Outcome(JobState.SUCCEEDED, value=1.0, summary=SUMMARY | DESIGN)


def run_worker() -> None:
    """A worker of the service."""
    import worker.main
    import worker.run_job

    worker.run_job.execute = no_solve  # type: ignore[assignment]
    worker.main.main()


def run_relay() -> None:
    """The relay of the service."""
    import worker.relay

    worker.relay.main()


def run_api() -> None:
    """The API, on the port that the environment names."""
    import api.main

    sys.argv[1:] = ["--port", os.environ["BENCHMARK_PORT"]]
    api.main.main()


def run_bare_worker() -> None:
    """A Celery worker that knows the empty task only."""
    settings = Settings()
    app = celery_app(settings.broker_url, queue=BARE_QUEUE, task_modules=["benchmarks.throughput"])
    app.worker_main(worker_arguments(settings.workers))


@contextmanager
def running(settings: Settings, *roles: Callable[[], None], **environment: str) -> Iterator[None]:
    """Processes with these settings, ended with SIGTERM."""
    given = {f"ARMATURE_{name.upper()}": str(value) for name, value in settings.model_dump().items()}
    processes = [PROCESSES.Process(target=_start, args=(role, given | environment)) for role in roles]
    for process in processes:
        process.start()
    try:
        yield
    finally:
        _end(processes)


def _start(role: Callable[[], None], environment: dict[str, str]) -> None:
    os.environ.update(environment)
    log = os.open(Path(environment["ARMATURE_HOME"]) / "log", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(log, sys.stdout.fileno())
    os.dup2(log, sys.stderr.fileno())
    sys.argv[1:] = []
    role()


def _end(processes: list[ForkServerProcess]) -> None:
    for process in processes:
        process.terminate()
    for process in processes:
        process.join()


def wait_for(holds: Callable[[], object]) -> float:
    """Look often; returns when it held (`time.perf_counter`)."""
    while not holds():
        time.sleep(LOOK_EVERY_S)
    return time.perf_counter()


def bare_rate(settings: Settings, tasks: int) -> float:
    """Bare tasks a second: from the first that was taken off a full queue to the last."""
    app = celery_app(settings.broker_url, queue=BARE_QUEUE)
    send(app, BARE_TASK, *range(tasks))
    with running(settings, run_bare_worker):
        began = wait_for(lambda: queue_size(app) < tasks)
        left = queue_size(app)
        ended = wait_for(lambda: queue_size(app) == 0)
    return left / (ended - began)


def path_rate(engine: Engine, settings: Settings, applications: int, tasks: int) -> float:
    """Jobs a second: from the moment at which the relay starts beside waiting workers to the last application's end."""
    with running(settings, run_worker):
        app = celery_app(settings.broker_url)
        send(app, "armature.run_job", "none")  # taken when the worker is ready
        wait_for(lambda: queue_size(app) == 0)
        for _ in range(applications):
            submit(engine, settings, request(tasks))
        before = finished(engine)
        with running(settings, run_relay):
            began = wait_for(lambda: finished(engine) > before)
            already = finished(engine)
            ended = wait_for(lambda: not unfinished(engine))
            return (finished(engine) - already) / (ended - began)


def request(tasks: int) -> ApplicationRequest:
    """An application of two stages with a job a task, and a reconcile between them."""
    return ApplicationRequest.model_validate(body(tasks))


def body(tasks: int) -> dict[str, Any]:
    """As a client sends it."""
    moves = [{"start_rad": [0.01 * k, -0.2, 0.3, 0.0, 0.1, 0.0], "end_rad": [0.0] * 6} for k in range(tasks)]
    return {"name": f"{tasks} moves", "tasks": moves}


def finished(engine: Engine) -> int:
    """Count the jobs that are final."""
    with reading(engine) as session:
        return session.scalar(select(func.count()).where(Job.state == JobState.SUCCEEDED)) or 0


def unfinished(engine: Engine) -> int:
    """Count the applications that are not."""
    final = [state for state in ApplicationState if state.final]
    with reading(engine) as session:
        return session.scalar(select(func.count()).where(Application.state.not_in(final))) or 0


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


def main() -> None:
    """Measure, keep, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--applications", type=int, default=40)
    parser.add_argument("--submitted", type=int, default=100, help="applications that the fifty clients submit")
    parser.add_argument("--tasks", type=int, default=100)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--no-latencies", action="store_true")
    arguments = parser.parse_args()
    jobs = arguments.applications * (2 * arguments.tasks + 1)
    found: dict[str, Any] = {"workers": arguments.workers, "jobs": jobs, "bare_per_s": [], "path_per_s": []}
    with (
        tempfile.TemporaryDirectory() as folder,
        redis_server("--appendonly", "yes") as redis,
        postgres_server(fsync=True) as postgres,
        postgres_database(postgres) as url,
    ):
        settings = Settings(
            home=Path(folder),
            database_url=url,
            broker_url=redis.url,
            workers=arguments.workers,
            **ABUNDANT,
        )
        upgrade(url)
        engine = make_engine(url)
        for _ in range(arguments.rounds):
            found["bare_per_s"].append(round(bare_rate(settings, jobs)))
            found["path_per_s"].append(round(path_rate(engine, settings, arguments.applications, arguments.tasks)))
            print(found, flush=True)
        if not arguments.no_latencies:
            found["latencies"] = {"Postgres, Redis": latencies(settings, arguments.submitted, arguments.tasks)}
            home = Path(folder) / "embedded"
            embedded = Settings(**ABUNDANT, home=home, workers=arguments.workers)
            upgrade(embedded.database_url)
            found["latencies"]["SQLite, embedded"] = latencies(embedded, arguments.submitted, arguments.tasks)
            print(found["latencies"], flush=True)
        engine.dispose()
    RESULTS.write_text(json.dumps(found, indent=1) + "\n")
    show(found)


def show(found: dict[str, Any]) -> None:
    """The tables of docs/performance.md."""
    bare_per_s, path_per_s = (statistics.median(found[name]) for name in ("bare_per_s", "path_per_s"))
    rows = [
        ["bare Celery tasks", f"{bare_per_s:.0f}", "1"],
        ["jobs through the whole path", f"{path_per_s:.0f}", f"**{path_per_s / bare_per_s:.2f}**"],
    ]
    put(
        "throughput", table([f"{found['jobs']} of them, {found['workers']} processes", "a second", "of the bare"], rows)
    )
    if "latencies" not in found:
        return
    named = {"submit": "submit 100 tasks", "status": "state of an application"}
    rows = [
        [pair, named[what], f"{at['count']}", *(f"{1e3 * at[q]:.0f}" for q in ("median_s", "p95_s", "most_s"))]
        for pair, asked in found["latencies"].items()
        for what, at in asked.items()
    ]
    put("latency", table(["on", "50 clients at once", "asked", "median ms", "95 % ms", "most ms"], rows))


if __name__ == "__main__":
    main()
