"""Whole applications through the service: `python benchmarks/fan_out.py [--tasks 25 100 500] [--workers 2]`.

Fan-out efficiency = solver seconds / (wall seconds x solver processes), from the first claim to the last finish. Solver
seconds are spent inside the solver and its certificate; the rest is the queue, the database and the broker.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

from armature.client import Client
from armature.processes import Place, running_service
from services.codesign.kernels import default_cache
from shared.contracts.results import ApplicationStatus
from shared.settings import Settings

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


def measure(client: Client, tasks: int, workers: int) -> None:
    """Run one application and print its row."""
    submitted = client.submit(application(tasks))
    status = submitted.wait()
    solves = sum(stage.succeeded + stage.failed for stage in status.progress.stages if stage.name != "reconcile")
    print(row(status, solves, workers))


def row(status: ApplicationStatus, solves: int, workers: int) -> str:
    """Figures of one application."""
    wall, solver = status.timings.wall_time_s or 0.0, status.timings.solver_time_s
    return (
        f"{status.tasks:6d} {solves:7d} {status.state:>24} {wall:9.1f} {solver:9.1f} {solver / (wall * workers):11.3f}"
        f" {1e3 * wall / solves:12.0f} {solves / wall / workers:14.2f}"
    )


def main() -> None:
    """Start the embedded service in a temporary home, and measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", type=int, nargs="+", default=[25, 100, 500])
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    print(" tasks  solves                    state    wall s  solver s  efficiency  ms per solve  solves/s/core")
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        default_cache().mkdir(parents=True, exist_ok=True)
        (home / "kernels").symlink_to(default_cache())
        place = Place(workers=arguments.workers)
        with running_service(Settings(home=home), place) as service, Client(service.url) as client:
            measure(client, 25, arguments.workers)  # warms up; its row shows it
            for tasks in arguments.tasks:
                measure(client, tasks, arguments.workers)


if __name__ == "__main__":
    main()
