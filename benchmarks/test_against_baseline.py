"""The paper's formulation and ours, side by side on three tasks of the paper; both must end in the same optimum.

Ours then solves all 25 tasks in the same run: the median over them stands beside the baseline's median over its three,
which takes most of a minute for each.

    python -m pytest -o addopts= benchmarks/test_against_baseline.py --benchmark-timer=time.process_time

CPU time of one core, in one run. What only happens once a process (importing, loading kernels, building programs) is
not counted, for either.
"""

from __future__ import annotations

import statistics
from functools import lru_cache

import pytest

from benchmarks.baseline import Baseline, Run
from benchmarks.conftest import AGAINST, ALL
from benchmarks.solve_time import PAYLOADS, STROKES, TOL, iterations_of, paper_problem, timed
from services.codesign.solution import Solution
from services.codesign.solve import solve
from services.codesign.solver import SolverOptions

THREE = ((0.2, 0.0), (0.6, 2.0), (1.0, 4.0))
"""Stroke [rad] and payload [kg]."""

EACH_TASK = pytest.mark.parametrize(
    ("stroke", "payload"),
    [
        pytest.param(*task, marks=pytest.mark.benchmark(group=f"{AGAINST}: {task[0]} rad, {task[1]:g} kg"))
        for task in THREE
    ],
)

ROUNDS = 5
ROUNDS_OF_ALL = 3

FINE = 1e-8
SAME = 1e-4
"""How much worse than the baseline's an optimum may be, relative, both at tol FINE."""


@lru_cache
def baseline() -> Baseline:
    """The program written out once; differentiating it comes with every solve."""
    return Baseline(paper_problem(*THREE[0]))


@lru_cache
def their_optimum(stroke: float, payload: float) -> float:
    """The baseline's [s], at tolerance FINE."""
    run = baseline().solve(paper_problem(stroke, payload), FINE)
    assert run.success
    return run.objective


@EACH_TASK
def test_paper_formulation(benchmark, stroke, payload):
    """One round: it takes most of a minute."""
    run: Run = benchmark.pedantic(baseline().solve, (paper_problem(stroke, payload), TOL), rounds=1)
    assert run.success
    optimum = their_optimum(stroke, payload)
    benchmark.extra_info |= {"solve_s": run.seconds, "iterations": run.iterations, "optimum_s": optimum}


@EACH_TASK
def test_ours(benchmark, stroke, payload):
    """A whole solve, from the guess to the answer."""
    problem = paper_problem(stroke, payload)
    solution: Solution = benchmark.pedantic(
        solve, (problem,), {"options": SolverOptions(tol=TOL)}, rounds=ROUNDS, warmup_rounds=1
    )
    optimum = solve(problem, options=SolverOptions(tol=FINE)).objective
    assert solution.success
    assert optimum is not None
    assert optimum < (1 + SAME) * their_optimum(stroke, payload)
    own, coarse = iterations_of(solution)
    benchmark.extra_info |= {"iterations": own, "coarse_iterations": coarse, "optimum_s": optimum}


@pytest.mark.benchmark(group=ALL)
def test_ours_on_all_tasks(benchmark):
    """Whole solves of the 25 tasks one after the other, several times; of each task its median counts."""
    problems = [paper_problem(stroke, payload) for stroke in STROKES for payload in PAYLOADS]
    rounds: list[list[tuple[float, Solution]]] = []

    def solve_all() -> None:
        rounds.append([timed(problem) for problem in problems])

    benchmark.pedantic(solve_all, rounds=ROUNDS_OF_ALL, warmup_rounds=1)
    seconds = [statistics.median(run[0] for run in task) for task in zip(*rounds[-ROUNDS_OF_ALL:], strict=True)]
    solutions = [run[1] for run in rounds[-1]]
    assert all(solution.success for solution in solutions)
    own, coarse = (int(statistics.median(counts)) for counts in zip(*map(iterations_of, solutions), strict=True))
    benchmark.extra_info |= {
        "median_s": statistics.median(seconds),
        "iterations": own,
        "coarse_iterations": coarse,
    }
