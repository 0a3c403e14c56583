"""The joint program of many tasks: `python -m benchmarks.shared_size [--tasks 25 100 500] [--iterations 6]`.

CPU seconds an iteration, memory, and how evenly two threads share the work. All in CPU time, which another program on
the machine changes little: the efficiency is the process's CPU time over twice that of its busier thread. Each size
runs in a process of its own, for its peak of memory. The tasks are the paper's 25 again and again, with payloads that
differ by a part in a thousand, started from their own motions; a few iterations show what one costs. With
`--iterations 500` the search goes to its end, where each 25 tasks have the total of the paper's 25, 7.669 s.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import time
from dataclasses import replace

import numpy as np

from services.codesign.problem import Problem, Task
from services.codesign.robot import Robot
from services.codesign.shared_optimum import SharedStart, solve_shared
from services.codesign.solve import solve
from services.codesign.solver import IterationReport, SolverOptions

THREADS = 2


def paper_problems() -> list[Problem]:
    """The paper's grid."""
    robot = Robot.preset("ur5")
    tasks = [Task(np.full(6, stroke), np.zeros(6), float(m)) for stroke in np.linspace(0.2, 1.0, 5) for m in range(5)]
    return [Problem(robot, task) for task in tasks]


def measure(given: list[Problem], start: SharedStart, tasks: int, iterations: int) -> None:
    """Run a few iterations with so many tasks, and print a row."""
    generator = np.random.default_rng(0)
    problems = []
    for k in range(tasks):
        problem = given[k % len(given)]
        payload = problem.task.payload * (1 + 1e-3 * generator.standard_normal())
        problems.append(replace(problem, task=replace(problem.task, payload=payload)))
    motions = [start.motions[k % len(given)] for k in range(tasks)]
    marks: list[tuple[float, float]] = []

    def watched(_: IterationReport) -> bool:
        marks.append((time.process_time(), time.thread_time()))
        return False

    began = time.process_time()
    options = SolverOptions(threads=THREADS, max_iter=iterations, max_wall_time=3600.0)
    found = solve_shared(problems, [1.0] * tasks, SharedStart(start.design, motions), options, watched)
    all_threads, this_one = (last - first for first, last in zip(marks[0], marks[-1], strict=True))
    efficiency = all_threads / THREADS / max(this_one, all_threads - this_one)
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
    each, setup = all_threads / (len(marks) - 1), marks[0][0] - began
    print(f"{tasks:6d} {each:20.3f} {efficiency:11.2f} {setup:12.1f} {peak_mb:8.0f}", end="", flush=True)
    per_25 = found.objective * len(given) / tasks
    print(f" {found.iterations:11d} {found.optimality.kkt_residual:8.1e} {per_25:11.4f} {found.status}", flush=True)


def main() -> None:
    """Solve the tasks once, then each size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", type=int, nargs="+", default=[25, 100, 500])
    parser.add_argument("--iterations", type=int, default=6)
    arguments = parser.parse_args()
    problems = paper_problems()
    own = [solve(problem) for problem in problems]
    design = own[len(own) // 2].design
    assert design is not None
    start = SharedStart(design, [s.motion for s in own if s.motion is not None])
    print(" tasks  CPU s an iteration  efficiency  setup CPU s  peak MB  iterations      KKT  s each 25t status")
    for tasks in arguments.tasks:
        process = multiprocessing.get_context("spawn").Process(
            target=measure, args=(problems, start, tasks, arguments.iterations)
        )
        process.start()
        process.join()


if __name__ == "__main__":
    main()
