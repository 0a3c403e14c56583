"""From the start of a worker to its first solve, with compiled kernels in the cache: `python -m benchmarks.start_up`.

Each run is a process of its own that does what a worker does before it can solve: import (`worker.main` does so once,
for all its processes), load the kernels and build the program and the solver object of the first task's grid. The first
solve's time less that of the same solve again is what the latter comes to. The median of `--runs` runs.
"""

from __future__ import annotations

import argparse
import importlib
import json
import statistics
import subprocess
import sys
import time

from benchmarks.tables import put, table

IMPORTS = (
    "numpy",
    "casadi",
    "sqlalchemy.orm",
    "celery.app.base",
    "celery.apps.worker",
    "worker.main",
)
REST = "the project and the rest"
FIRST = "kernels, program and solver object of the first grid"

Times = dict[str, tuple[float, float]]
"""Wall and CPU seconds."""


def clocks() -> tuple[float, float]:
    """Wall and CPU seconds; the latter since the process began."""
    return time.perf_counter(), time.process_time()


def start() -> Times:
    """In a new process: what each step took."""
    times: Times = {"the interpreter": (0.0, time.process_time())}  # its wall time is known to the parent

    def timed(name: str, began: tuple[float, float]) -> None:
        ended = clocks()
        times[name] = (ended[0] - began[0], ended[1] - began[1])

    for module in IMPORTS:
        began = clocks()
        importlib.import_module(module)
        timed(
            f"import {module.partition('.')[0]}" if module != "celery.apps.worker" else "import celery's worker", began
        )
    began = clocks()
    importlib.import_module("worker.tasks")
    importlib.import_module("shared.observability")
    importlib.import_module("shared.db.revision")
    timed(REST, began)

    from benchmarks.solve_time import paper_problem
    from services.codesign.certify import certify
    from services.codesign.solve import solve

    def solved() -> tuple[float, float]:
        began = clocks()
        certify(solve(paper_problem(0.6, 2.0)))
        ended = clocks()
        return ended[0] - began[0], ended[1] - began[1]

    first, again = solved(), min(solved() for _ in range(3))
    times[FIRST] = (first[0] - again[0], first[1] - again[1])
    return times


def main() -> None:
    """Start processes, and write the section of docs/performance.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        print(json.dumps(start()))
        return
    command = [sys.executable, "-m", "benchmarks.start_up", "--child"]
    found = []
    for _ in range(arguments.runs + 1):
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        found.append(json.loads(done.stdout.splitlines()[-1]))
    found = found[1:]  # the first may compile kernels, and reads its files from the disk
    rows = []
    for name in found[0]:
        wall, cpu = (statistics.median(times[name][k] for times in found) for k in (0, 1))
        rows.append([name, f"{1e3 * wall:.0f}", f"{1e3 * cpu:.0f}"])
    whole = [statistics.median(sum(times[name][k] for name in times) for times in found) for k in (0, 1)]
    rows.append(["together", *(f"**{1e3 * seconds:.0f}**" for seconds in whole)])
    put("start-up", table(["until the first solve", "wall ms", "CPU ms"], rows))


if __name__ == "__main__":
    main()
