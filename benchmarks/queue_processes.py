"""Processes of the service for benchmarks of its queue: as they are, but for the solves, which compute nothing."""

from __future__ import annotations

import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Any

from services.jobs.finish import Outcome
from services.jobs.work import Work
from shared.contracts.application import ApplicationRequest
from shared.domain import JobState, Stage
from shared.settings import Settings
from worker import drain

PROCESSES = multiprocessing.get_context("forkserver")
PROCESSES.set_forkserver_preload(["__main__", "api.main", "worker.main", "worker.relay"])
"""Forked from a process that has imported everything: what is measured begins sooner."""

SUMMARY = {"objective": 1.0, "final_time_s": 1.0, "solver_status": "Solve_Succeeded", "solve_time_s": 0.0}
DESIGN = {"design_mm": [[30.0, 20.0, 40.0, 2.0, 6.0, 7.0, 2.0]] * 6}


def no_solve(work: Work, *_: Any) -> Outcome:
    """In place of `services.jobs.execute.execute`."""
    if work.spec.stage == Stage.RECONCILE:
        return Outcome(JobState.SUCCEEDED, summary={"methods": ["two_step"]}, designs={"two_step": DESIGN})
    return Outcome(JobState.SUCCEEDED, value=1.0, summary=SUMMARY | DESIGN)


def run_worker() -> None:
    """A worker of the service."""
    # The flag was made before the fork, and may still say that the worker before was told to end.
    drain._shared[:] = bytes(len(drain._shared))
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


LOOK_EVERY_S = 0.1
"""Rarely enough to take nothing away from what is measured."""


def wait_for(holds: Callable[[], object]) -> float:
    """Look often; returns when it held (`time.perf_counter`)."""
    while not holds():
        time.sleep(LOOK_EVERY_S)
    return time.perf_counter()


def request(tasks: int) -> ApplicationRequest:
    """An application of two stages with a job a task, and a reconcile between them."""
    return ApplicationRequest.model_validate(body(tasks))


def body(tasks: int) -> dict[str, Any]:
    """As a client sends it."""
    moves = [{"start_rad": [0.01 * k, -0.2, 0.3, 0.0, 0.1, 0.0], "end_rad": [0.0] * 6} for k in range(tasks)]
    return {"name": f"{tasks} moves", "tasks": moves}
