"""Whole applications through the service: `python -m benchmarks.fan_out [--tasks 10 25 100 500] [--workers 2]`.

Fan-out efficiency = solver seconds / (wall seconds x solver processes), from the first claim to the last finish. It is
given twice: with the seconds inside IPOPT alone; and with those of whole solves, from the guess to the certificate, for
no motion is a result before its voltages were replayed. The rest of a job is its inputs and outcome; between jobs are
the messages, and the wait for the slowest at a stage's end.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
from sqlalchemy import Engine, func, select

from armature.client import Client
from armature.processes import Place, running_service
from benchmarks.tables import ROOT, put, table
from services.codesign.kernels import default_cache
from shared.db.engine import make_engine, reading
from shared.db.tables import Job, Result
from shared.settings import Settings

mpl.use("Agg")
from matplotlib import pyplot as plt

IMAGE = ROOT / "docs" / "images" / "tasks.svg"

PAPER = {"scheme": "radau", "degree": 1, "intervals": 50, "control": "voltage"}
LONGEST_STROKE, SHORTEST_STROKE = 1.0, 0.2
PAYLOADS_KG = [0.0, 1.0, 2.0, 3.0, 4.0]


def application(tasks: int) -> dict[str, Any]:
    """The paper's application with `tasks` tasks: five payloads, and as many strokes as it takes."""
    strokes = tasks // len(PAYLOADS_KG)
    step = (LONGEST_STROKE - SHORTEST_STROKE) / (strokes - 1)
    stroke = [round(SHORTEST_STROKE + step * k, 6) for k in range(strokes)]
    grid = {"stroke": stroke, "payload_kg": PAYLOADS_KG}
    return {"name": f"{tasks} tasks", "tasks": {"grid": grid}, "transcription": PAPER}


@dataclass(frozen=True)
class Spent:
    """Seconds of one application, over all solver processes; `wall` from the first claim to the last finish."""

    tasks: int
    solves: int
    wall: float
    ipopt: float
    rest_of_solve: float
    certificate: float
    jobs: float


def measure(client: Client, engine: Engine, tasks: int) -> Spent:
    """Run one application to its end."""
    submitted = client.submit(application(tasks))
    status = submitted.wait()
    assert status.state == "succeeded", f"{tasks} tasks: {status.state}, {status.reason}"
    with reading(engine) as session:
        mine = Job.application_id == submitted.id
        first, last, inside = session.execute(
            select(
                func.min(Job.started_at), func.max(Job.finished_at), func.sum(Job.finished_at - Job.started_at)
            ).where(mine)
        ).one()
        summaries = session.scalars(select(Result.summary).where(Result.application_id == submitted.id)).all()
    solves = [summary for summary in summaries if "certificate_time_s" in summary]
    whole, certificate = (sum(summary[key] for summary in solves) for key in ("solve_time_s", "certificate_time_s"))
    ipopt = sum(attempt["solve_time_s"] for summary in solves for attempt in summary["attempts"])
    return Spent(tasks, len(solves), last - first, ipopt, whole - ipopt, certificate, inside)


def rows_of(runs: list[Spent], workers: int) -> str:
    """The figures, as a table."""
    rows = []
    for run in runs:
        whole = run.wall * workers
        solving = run.ipopt + run.rest_of_solve + run.certificate
        parts = (run.ipopt, run.rest_of_solve, run.certificate, run.jobs - solving, whole - run.jobs)
        rows.append(
            [
                str(run.tasks),
                str(run.solves),
                f"{run.wall:.1f}",
                *(f"{part / whole:.1%}" for part in parts),
                f"{run.ipopt / whole:.2f}",
                f"**{solving / whole:.2f}**",
                f"{1e3 * run.wall / run.solves:.0f}",
                f"{run.solves / whole:.1f}",
            ]
        )
    head = [
        "tasks",
        "solves",
        "wall s",
        "IPOPT",
        "rest of the solve",
        "certificate",
        "rest of the jobs",
        "between jobs",
    ]
    head += ["IPOPT alone", "efficiency", "ms per solve, wall", "solves/s per process"]
    return table(head, rows)


def plot(runs: list[Spent]) -> None:
    """Wall time a solve against the number of tasks."""
    figure, axis = plt.subplots(figsize=(4.5, 3), layout="constrained")
    tasks, each = [run.tasks for run in runs], [1e3 * run.wall / run.solves for run in runs]
    axis.plot(tasks, each, "o-", color="black", linewidth=1)
    axis.set(xlabel="tasks", ylabel="ms a solve, wall", xscale="log", ylim=(0, 1.1 * max(each)))
    axis.set_xticks(tasks, labels=[str(count) for count in tasks])
    axis.minorticks_off()
    axis.spines[["top", "right"]].set_visible(False)
    mpl.rcParams["svg.hashsalt"] = "tasks"
    figure.savefig(IMAGE, metadata={"Date": None})


def main() -> None:
    """Start the embedded service in a temporary home, and measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", type=int, nargs="+", default=[10, 25, 100, 500])
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        default_cache().mkdir(parents=True, exist_ok=True)
        (home / "kernels").symlink_to(default_cache())
        settings, place = Settings(home=home), Place(workers=arguments.workers)
        with running_service(settings, place) as service, Client(service.url) as client:
            engine = make_engine(settings.database_url)
            measure(client, engine, 10)  # loads kernels and builds programs, in every process
            runs = [measure(client, engine, tasks) for tasks in arguments.tasks]
            engine.dispose()
    put("application", rows_of(runs, arguments.workers))
    plot(runs)


if __name__ == "__main__":
    main()
