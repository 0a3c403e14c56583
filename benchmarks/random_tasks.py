"""Whether every task is solved or explained: random tasks all over the joint ranges.

python -m benchmarks.random_tasks                     200 tasks, a hundred an arm, for time
python -m benchmarks.random_tasks --kind energy       the same motions in twice their shortest time
python -m benchmarks.random_tasks --count 20          fewer
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from dataclasses import replace

import numpy as np

from benchmarks.tables import put, table
from services.codesign.problem import Objective, Problem, Task
from services.codesign.robot import Robot
from services.codesign.solution import Solution
from services.codesign.solve import solve

PRESETS = ("ur5", "ur5_modern_robotics")
SEED = 20240


def random_problems(count: int) -> list[Problem]:
    """Tasks from rest to rest, both ends uniform in the joint ranges, payload uniform in 0-4 kg; arms in turn."""
    rng = np.random.default_rng(SEED)
    robots = [Robot.preset(name) for name in PRESETS]
    problems = []
    for k in range(count):
        robot = robots[k % len(robots)]
        ends = [rng.uniform(robot.joint_lower, robot.joint_upper) for _ in range(2)]
        problems.append(Problem(robot, Task(*ends, rng.uniform(0, 4))))
    return problems


def solved(problem: Problem, kind: str) -> Solution:
    """Solve for time, or for energy in twice the shortest time."""
    if kind == "time":
        return solve(problem)
    fastest = solve(problem)
    if fastest.measures is None:
        return fastest
    task = replace(problem.task, duration=2 * fastest.measures.final_time)
    return solve(replace(problem, task=task, objective=Objective("energy")))


def main() -> None:
    """Solve them all and write what became of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--kind", choices=("time", "energy"), default="time")
    arguments = parser.parse_args()
    rungs: Counter[str] = Counter()
    seconds, iterations, failures = [], [], []
    for k, problem in enumerate(random_problems(arguments.count)):
        began = time.process_time()
        solution = solved(problem, arguments.kind)
        if solution.success:
            rungs[solution.attempts[-1].name] += 1
            seconds.append(time.process_time() - began)
            iterations.append(solution.iterations)
        else:
            failures.append((k, problem, solution))
    done = arguments.count - len(failures)
    rows = [
        ["solved", f"{done} ({done / arguments.count:.1%})"],
        *([f"… on the rung “{name}”", str(number)] for name, number in rungs.most_common()),
        ["CPU time of a solved one, median / 95 % / most", f"{_spread(seconds, '.2f')} s"],
        ["iterations of a solved one, all attempts, median / 95 % / most", _spread(iterations, ".0f")],
    ]
    reasons = [
        f"Task {k} ({problem.robot.name}, {problem.task.payload:.2f} kg): {solution.status}: {solution.reason}"
        for k, problem, solution in failures
    ]
    put(
        f"random {arguments.kind}",
        "\n\n".join([table([f"for {arguments.kind}", str(arguments.count)], rows), *reasons]),
    )


def _spread(values: list[float], form: str) -> str:
    return " / ".join(format(value, form) for value in np.percentile(values, [50, 95, 100]))


if __name__ == "__main__":
    main()
