"""Where a job's time goes, in a worker's process: `python -m benchmarks.job_parts [--tasks 25]`.

One process does every job of the paper's application, as a worker's process does (`worker.run_job`), on an embedded
database of its own. Each part is timed where it is called, in CPU time, the parts called inside it left out, so that
the parts add up to the whole. What only a whole service has (messages, other processes) is in `benchmarks.fan_out`.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import patch

from sqlalchemy import Engine, select

import services.codesign.certify
import services.codesign.ladder
import services.codesign.solve
import services.codesign.starts
import services.jobs.execute
import worker.run_job
from benchmarks.fan_out import application
from benchmarks.tables import put, table
from services.codesign.kernels import default_cache
from services.jobs.submit import submit
from shared.contracts.application import ApplicationRequest
from shared.db.engine import make_engine, reading
from shared.db.migrate import upgrade
from shared.db.tables import Job
from shared.domain import JobState, Stage
from shared.settings import Settings

SOLVER, REPLAY = "IPOPT", "replay"

PARTS: dict[str, list[tuple[Any, str]]] = {
    "claim": [(worker.run_job, "claim")],
    "inputs read": [(worker.run_job, "load_work")],
    "guess": [(services.codesign.ladder, "quintic_guess"), (services.codesign.ladder, "motion_guess")],
    SOLVER: [(services.codesign.ladder, "run")],
    "optimality": [(services.codesign.solve, "optimality")],
    REPLAY: [(services.codesign.certify, "replay")],
    "rest of the certificate": [(services.jobs.execute, "certify")],
    "limits' costs": [(services.jobs.execute, "limit_slopes")],
    "arrays packed": [(services.jobs.execute, "pack")],
    "hash of the inputs": [(services.jobs.execute, "input_hash")],
    "rest of the solve": [(services.codesign.starts, "solve")],
    "rest of the job": [(worker.run_job, "execute")],
    "finish": [(worker.run_job, "finish")],
}
"""Where each part is called from; a part inside another counts for itself alone."""

REST = "heartbeat, log"


@dataclass
class Clock:
    """CPU seconds of each part, without the parts inside it."""

    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    _inside: list[float] = field(default_factory=list)

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Time what happens meanwhile."""
        began = time.thread_time()
        self._inside.append(0.0)
        try:
            yield
        finally:
            took = time.thread_time() - began
            self.seconds[name] += took - self._inside.pop()
            if self._inside:
                self._inside[-1] += took

    def timed(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        """The same call, timed."""

        def timed(*arguments: Any, **named: Any) -> Any:
            with self.part(name):
                return call(*arguments, **named)

        return timed


def run_application(engine: Engine, settings: Settings, tasks: int) -> dict[Stage, tuple[int, dict[str, float]]]:
    """Number of jobs and seconds of each part, by stage."""
    request = ApplicationRequest.model_validate(application(tasks))
    application_id, _ = submit(engine, settings, request)
    stages: dict[Stage, tuple[int, dict[str, float]]] = {}
    while jobs := _queued(engine, application_id):
        clock = Clock()
        with ExitStack() as patches:
            for name, places in PARTS.items():
                for module, call in places:
                    patches.enter_context(patch.object(module, call, clock.timed(name, getattr(module, call))))
            for job_id, _ in jobs:
                with clock.part(REST):
                    worker.run_job.run_job(engine, settings, job_id)
        stages[jobs[0][1]] = (len(jobs), dict(clock.seconds))
    return stages


def _queued(engine: Engine, application_id: str) -> list[tuple[str, Stage]]:
    with reading(engine) as session:
        rows = session.execute(
            select(Job.id, Job.stage)
            .where(Job.application_id == application_id, Job.state == JobState.QUEUED)
            .order_by(Job.task_index)
        ).all()
    return [(row.id, Stage(row.stage)) for row in rows]


def shares(stages: dict[Stage, tuple[int, dict[str, float]]]) -> str:
    """Milliseconds a job, by part and stage, and the shares of both stages of solves together."""
    solves = {name: stages[name] for name in (Stage.CODESIGN, Stage.MOTIONS)}
    whole = sum(sum(seconds.values()) for _, seconds in solves.values())
    rows = []
    for part in (*PARTS, REST):
        together = sum(seconds.get(part, 0.0) for _, seconds in solves.values())
        each = [f"{1e3 * seconds.get(part, 0.0) / jobs:.1f}" for jobs, seconds in solves.values()]
        rows.append([part, *each, f"{together / whole:.1%}"])
    totals = [f"**{1e3 * sum(seconds.values()) / jobs:.1f}**" for jobs, seconds in solves.values()]
    return table(["ms a job", "co-design", "motions", "share of both"], [*rows, ["together", *totals, ""]])


@contextmanager
def embedded(cache: Path) -> Iterator[tuple[Engine, Settings]]:
    """An empty database in a folder of its own, with the compiled kernels that are there."""
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        cache.mkdir(parents=True, exist_ok=True)
        (home / "kernels").symlink_to(cache)
        settings = Settings(home=home)
        upgrade(settings.database_url)
        engine = make_engine(settings.database_url)
        try:
            yield engine, settings
        finally:
            engine.dispose()


def main() -> None:
    """Measure, and write the section of docs/performance.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", type=int, default=25)
    arguments = parser.parse_args()
    with embedded(default_cache()) as (engine, settings):
        run_application(engine, settings, 10)  # loads kernels and builds programs
        put("job parts", shares(run_application(engine, settings, arguments.tasks)))


if __name__ == "__main__":
    main()
