"""How long it takes to find that a task cannot be done: `python -m benchmarks.infeasible_tasks`.

Three kinds of tasks, some of which can be done: the paper's for energy with the two-step's design, random ones with
motors that were not made for them, and random ones in a little less or more than their shortest time.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.random_tasks import random_problems
from benchmarks.solve_time import PAYLOADS, STROKES, paper_problem
from benchmarks.tables import put, table
from services.codesign.problem import Objective, Problem
from services.codesign.reconcile import mean_design, project_design
from services.codesign.solution import NOT_ATTEMPTED
from services.codesign.solve import solve
from services.codesign.starts import starting_point

COUNT = 24
"""Random tasks of a kind."""

SHARES = (0.9, 0.97, 0.995, 1.005, 1.02)
"""Of the shortest time, in turn."""

ENERGY = Objective("energy")


def with_the_two_steps_design() -> Iterator[Problem]:
    """The paper's motions for energy, with the mean of the tasks' own designs."""
    own = [paper_problem(stroke, payload, "energy") for stroke in STROKES for payload in PAYLOADS]
    designs = [design for problem in own if (design := solve(problem).design) is not None]
    shared = project_design(mean_design(designs), own[0].motor).design
    yield from (replace(problem, design=shared) for problem in own)


def with_other_motors() -> Iterator[Problem]:
    """For energy in 1.5 to 3 s, with motors drawn at random."""
    rng = np.random.default_rng(2)
    for k, problem in enumerate(random_problems(COUNT)):
        design, _ = starting_point(problem, k + 1)
        task = replace(problem.task, duration=float(rng.uniform(1.5, 3)))
        yield replace(problem, design=design, task=task, objective=ENERGY)


def near_the_shortest_time() -> Iterator[Problem]:
    """For energy, in shares of the shortest time found."""
    for k, problem in enumerate(random_problems(COUNT)):
        fastest = solve(problem)
        assert fastest.measures is not None
        duration = SHARES[k % len(SHARES)] * fastest.measures.final_time
        yield replace(problem, task=replace(problem.task, duration=duration), objective=ENERGY)


KINDS = {
    "the paper's, the two-step's design": with_the_two_steps_design,
    "random, other motors": with_other_motors,
    "random, near the shortest time": near_the_shortest_time,
}


def main() -> None:
    """Solve them all and write what it took."""
    rows = []
    for name, problems in KINDS.items():
        proven, solved, failed = 0, 0, []
        for problem in problems():
            began = time.process_time()
            solution = solve(problem)
            seconds = time.process_time() - began
            if solution.success:
                solved += 1
            elif solution.status == NOT_ATTEMPTED:
                proven += 1
            else:
                failed.append(seconds)
        spread = [f"{np.median(failed):.1f}", f"{max(failed):.1f}"] if failed else ["", ""]
        rows.append([name, str(solved), str(proven), str(len(failed)), *spread])
    head = ["for energy", "solved", "refused before any solve", "explained after a failed solve"]
    put("infeasible", table([*head, "CPU s of these, median", "most"], rows))


if __name__ == "__main__":
    main()
