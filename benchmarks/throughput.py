"""How many jobs a second go through the whole path, beside bare Celery tasks; and how soon the API answers meanwhile.

    python -m benchmarks.throughput [--rounds 3] [--applications 12] [--tasks 100] [--workers 2]

Postgres with fsync on and Redis from `tests/servers.py`, all on this machine. A job's solve is a stand-in that computes
nothing; everything else is what a worker does: message, claim, inputs, finish, next stage, next message. Bare tasks do
nothing at all: their queue is filled first, and only its draining is timed. Both in turn, on the same broker, with the
same number of processes; the ratio is that of the medians.

Then fifty clients submit a hundred applications of a hundred tasks at once through one API process, while the same
workers go through them, and each asks for the state of its applications once a second for twenty seconds; on Postgres
and Redis, then on SQLite and the embedded broker.

Results: benchmarks/results/throughput.json, and a table in docs/performance.md.
"""

from __future__ import annotations

import argparse
import json
import statistics
import tempfile
from pathlib import Path
from typing import Any

from celery import shared_task
from sqlalchemy import Engine, func, select

from benchmarks.answers import latencies
from benchmarks.queue_processes import request, run_relay, run_worker, running, wait_for
from benchmarks.tables import put, table
from services.jobs.submit import submit
from shared.db.engine import make_engine, reading
from shared.db.migrate import upgrade
from shared.db.tables import Application, Job
from shared.dispatch.broker import celery_app, queue_size, send, worker_arguments
from shared.domain import ApplicationState, JobState
from shared.settings import Settings
from tests.servers import postgres_database, postgres_server, redis_server

RESULTS = Path(__file__).parent / "results" / "throughput.json"
BARE_QUEUE, BARE_TASK = "bare", "benchmark.bare"

ABUNDANT: dict[str, Any] = {"max_queued_jobs": 10**6, "rate_per_minute": 0}
"""Limits that stand in nobody's way."""


@shared_task(name=BARE_TASK)  # type: ignore[untyped-decorator]
def bare(_: int) -> None:
    """Nothing."""


def run_bare_worker() -> None:
    """A Celery worker that knows the empty task only."""
    settings = Settings()
    app = celery_app(settings.broker_url, queue=BARE_QUEUE, task_modules=["benchmarks.throughput"])
    app.worker_main(worker_arguments(settings.workers))


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


def finished(engine: Engine) -> int:
    """Count the jobs that are final."""
    with reading(engine) as session:
        return session.scalar(select(func.count()).where(Job.state == JobState.SUCCEEDED)) or 0


def unfinished(engine: Engine) -> int:
    """Count the applications that are not."""
    final = [state for state in ApplicationState if state.final]
    with reading(engine) as session:
        return session.scalar(select(func.count()).where(Application.state.not_in(final))) or 0


def main() -> None:
    """Measure, keep, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--applications", type=int, default=12)
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
