"""The shared optimum beside the two-step, both through the service: `python -m benchmarks.shared_optimum [--tasks 25]`.

One application of `method: shared_optimum` does what the two-step does (the tasks' own designs, their mean, the motions
with it), the motions with the empirical design, and then solves the joint program from the better of the two. So one
run gives both times on the same machine: from the first claim to the last of the two-step's motions, and to the shared
design. The empirical motions count as part of the latter: they are where it starts from.
Stored in benchmarks/results/shared_optimum.json, which `make studies` writes the table of docs/shared_optimum.md from;
with the memory of the largest process that there was, which is the one that solves the joint program.
"""

from __future__ import annotations

import argparse
import json
import resource
import tempfile
from pathlib import Path
from typing import Any

from sqlalchemy import Engine, func, select

from armature.client import Client
from armature.processes import Place, running_service
from benchmarks.fan_out import application
from services.codesign.kernels import default_cache
from services.jobs.resolved import SHARED
from shared.db.engine import make_engine, reading
from shared.db.tables import Job
from shared.domain import Stage
from shared.settings import Settings

RESULTS = Path(__file__).parent / "results" / "shared_optimum.json"
OBJECTIVES: dict[str, dict[str, Any]] = {
    "time": {"kind": "time"},
    "energy, 1 s": {"kind": "energy"},
    "weighted, alpha 0.5": {"kind": "weighted", "alpha": 0.5},
}


def measure(client: Client, engine: Engine, tasks: int, objective: dict[str, Any]) -> dict[str, Any]:
    """Run one application to its end; totals, times [s], and how the joint solve went."""
    request = application(tasks) | {
        "objective": objective,
        "method": "shared_optimum",
        "compare": ["two_step", "empirical"],
    }
    request["tasks"]["grid"]["duration_s"] = 1.0
    submitted = client.submit(request)
    status = submitted.wait()
    begin, ends = _clock(engine, submitted.id)
    compared, design = submitted.comparison(), submitted.designs().methods["shared_optimum"]
    two_step, shared = ends[Stage.MOTIONS, "two_step"] - begin, ends[Stage.SHARED_OPTIMUM, SHARED] - begin
    return {
        "tasks": tasks,
        "objective": objective,
        "state": status.state,
        "unit": compared.unit,
        "tasks_compared": len(compared.tasks_compared),
        "totals": {name: method.total_objective for name, method in compared.methods.items()},
        "start": design.start,
        "joint_total": design.convergence[-1][1] if design.convergence else None,
        "iterations": design.iterations,
        "solve_s": design.solve_time_s,
        "solver_status": design.solver_status,
        "kkt_residual": design.kkt_residual,
        "two_step_s": two_step,
        "shared_s": shared,
        "ratio": shared / two_step,
        "with_motions_s": ends[Stage.SHARED_MOTIONS, SHARED] - begin,
    }


def _clock(engine: Engine, application_id: str) -> tuple[float, dict[tuple[str, str], float]]:
    """When the first job began, and when the last of each stage and method ended."""
    with reading(engine) as session:
        rows = session.execute(
            select(Job.stage, Job.method, func.min(Job.started_at), func.max(Job.finished_at))
            .where(Job.application_id == application_id)
            .group_by(Job.stage, Job.method)
        ).all()
    return min(begin for *_, begin, _ in rows), {(stage, method): end for stage, method, _, end in rows}


def main() -> None:
    """Start the embedded service in a temporary home, measure, store."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", type=int, default=25)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--objectives", nargs="+", choices=OBJECTIVES, default=list(OBJECTIVES))
    arguments = parser.parse_args()
    runs: dict[str, dict[str, Any]] = {}
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        default_cache().mkdir(parents=True, exist_ok=True)
        (home / "kernels").symlink_to(default_cache())
        settings = Settings(home=home)
        with running_service(settings, Place(workers=arguments.workers)) as service, Client(service.url) as client:
            client.submit(application(10)).wait()  # compiles and loads the kernels
            engine = make_engine(settings.database_url)
            for name in arguments.objectives:
                found = measure(client, engine, arguments.tasks, OBJECTIVES[name])
                print(name, json.dumps(found), flush=True)
                runs[f"{arguments.tasks} tasks, {name}"] = found
    # Of all processes, which have ended by now and were waited for.
    largest_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024 / 1e6
    stored = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    stored |= {name: found | {"largest_process_mb": largest_mb} for name, found in runs.items()}
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps(stored, indent=1) + "\n")


if __name__ == "__main__":
    main()
