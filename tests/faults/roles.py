"""The service's processes as they are, but for the solves, which take as long as a file says and compute nothing.

Each role is a function that a process runs to its end. The environment is set before, so that `Settings()` finds it.
What a test says while they run is in the home folder: `SOLVE_S`, `DEADLY_TASK`; what they say is in `EXECUTIONS`.
"""

from __future__ import annotations

import mmap
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import sqlalchemy.event
from sqlalchemy import Engine

import api.main
import services.jobs.outbox
import worker.drain
import worker.main
import worker.relay
import worker.run_job
import worker.tasks
from services.codesign.solver import IterationReport
from services.jobs.finish import Outcome
from shared.domain import JobState, Stage
from shared.settings import Settings
from tests.service.queue_actions import outcome_of
from worker.sign_of_life import worker_name

SOLVE_S = "solve_s"
"""How long a solve takes [s]; read all the time, so that solves at hand can be ended."""
DEADLY_TASK = "deadly_task"
"""Index of the task whose co-design kills its process, when the file is there."""
RAISING_TASK = "raising_task"
"""Index of the task whose co-design raises an exception, when the file is there."""
DEATH = "death"
"""The next process that is about to count a finished job is killed, when the file is there; it takes the file along."""
EXECUTIONS = "executions"
"""A line for every solve that was begun: stage, method, task index."""

ITERATION_S = 0.01


def start(role: str, environment: dict[str, str]) -> None:
    """Run a role in this process, which is new."""
    os.environ.update(environment)
    log = os.open(Path(environment["ARMATURE_HOME"]) / "log", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(log, sys.stdout.fileno())
    os.dup2(log, sys.stderr.fileno())
    ROLES[role]()


def run_worker() -> None:
    """A worker whose solves are stand-ins."""
    # Shared by a worker and its children; not made anew, it would be shared by all workers, which have one parent here.
    worker.drain._shared = mmap.mmap(-1, len(worker.drain._shared))
    worker.run_job.execute = _stand_in  # type: ignore[assignment]
    sys.argv = ["worker"]
    worker.main.main()


def run_worker_that_dies_counting() -> None:
    """A worker of whose processes one is killed when it has lowered a stage's counter, and not committed.

    Postgres has the result and the rest of the finish in the same statement; SQLite gets the result after it. What is
    committed with its statement has no such moment, and is left alone: the last job of a stage is not.

    Once each time that `DEATH` is there.
    """

    def die(*event: Any) -> None:
        connection, _, statement = event[:3]
        at_once = connection.get_execution_options().get("isolation_level") == "AUTOCOMMIT"
        if "UPDATE stages " in statement and not at_once:
            with suppress(FileNotFoundError):
                (_home() / DEATH).unlink()
                os.kill(os.getpid(), signal.SIGKILL)

    sqlalchemy.event.listen(Engine, "after_cursor_execute", die)
    run_worker()


def run_relay() -> None:
    """The relay."""
    worker.relay.main()


def run_dying_relay() -> None:
    """A relay that is killed after it published and before it marked, however many messages the broker holds."""

    def die(*_: Any) -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    services.jobs.outbox.AHEAD = 10**6
    services.jobs.outbox._put_off = die
    worker.relay.main()


def run_tenfold_relay() -> None:
    """A relay that publishes everything ten times."""
    once = worker.relay.send

    def send(*message: Any) -> None:
        for _ in range(10):
            once(*message)

    worker.relay.send = send
    worker.relay.main()


def run_api() -> None:
    """The API on the port that the environment names."""
    sys.argv = ["api", "--port", os.environ["ARMATURE_TEST_PORT"]]
    api.main.main()


ROLES: dict[str, Callable[[], None]] = {
    "worker": run_worker,
    "worker that dies counting": run_worker_that_dies_counting,
    "relay": run_relay,
    "dying relay": run_dying_relay,
    "tenfold relay": run_tenfold_relay,
    "api": run_api,
}


def _stand_in(work: Any, _options: Any, progress: Callable[[IterationReport], bool], *_: Any) -> Outcome:
    """In place of `services.jobs.execute.execute`: the result says which process it is from."""
    home, spec = _home(), work.spec
    with (home / EXECUTIONS).open("a") as file:  # one short append: whole lines, whoever else writes
        file.write(f"{spec.stage} {spec.method or '-'} {spec.task_index}\n")
    deadly = home / DEADLY_TASK
    if spec.stage == Stage.CODESIGN and deadly.exists() and int(deadly.read_text()) == spec.task_index:
        os.kill(os.getpid(), signal.SIGKILL)
    raising = home / RAISING_TASK
    if spec.stage == Stage.CODESIGN and raising.exists() and int(raising.read_text()) == spec.task_index:
        raise ArithmeticError("the matrix is singular")
    began, iteration = time.monotonic(), 0
    while time.monotonic() - began < _solve_s(home):
        if progress(IterationReport(0, iteration, 1.0)):
            return Outcome(JobState.CANCELLED, "stopped by request")
        iteration += 1
        time.sleep(ITERATION_S)
    outcome = outcome_of(work)  # which looks at `spec` only
    return replace(outcome, summary={**outcome.summary, "solved_by": worker_name()})


@lru_cache(maxsize=1)
def _home() -> Path:
    return Settings().home


def _solve_s(home: Path) -> float:
    return float((home / SOLVE_S).read_text() or "inf")  # empty while it is being written
