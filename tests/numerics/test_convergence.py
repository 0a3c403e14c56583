"""Grids refined: a published optimum, two schemes that must meet, and the order at which minimum times settle."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest

from services.codesign.collocation import collocation
from services.codesign.problem import Transcription
from services.codesign.solve import Solution, SolverOptions, solve
from tests.numerics.tasks import paper_problem

COPS_FINAL_TIME = 9.14093620
"""Robot arm of Dolan, More and Munson, Benchmarking Optimization Software with COPS 3.0 (2004), problem 10."""

TIGHT = SolverOptions(tol=1e-9)


def robot_arm_of_cops(intervals: int, degree: int) -> float:
    """Minimum time of the benchmark, controls constant on each interval, by this project's collocation."""
    scheme, length = collocation("radau", degree), 5.0
    start = np.array([4.5, 0, np.pi / 4, 0, 0, 0])
    end = np.array([4.5, 2 * np.pi / 3, np.pi / 4, 0, 0, 0])
    low, high = np.array([0, -np.pi, 0, -9, -9, -9]), np.array([length, np.pi, np.pi, 9, 9, 9])
    final_time = ca.MX.sym("final_time")
    variables, bounds, guess, defects = [final_time], [([1.0], [20.0])], [np.array([9.0])], []
    x = ca.DM(start)
    for w in range(intervals):
        u = ca.MX.sym("u", 3)
        points = [x, *(ca.MX.sym("x", 6) for _ in range(degree))]
        variables += [u, *points[1:]]
        bounds += [(-np.ones(3), np.ones(3)), *[(low, high)] * degree]
        guess += [np.zeros(3), *(start + (end - start) * (w + c) / intervals for c in scheme.points)]
        for point, row in zip(points[1:], scheme.differentiation, strict=True):
            inertia = ((length - point[0]) ** 3 + point[0] ** 3) / 3
            forces = ca.vertcat(u[0] / length, u[1] / (inertia * ca.sin(point[2]) ** 2), u[2] / inertia)
            slope = sum(float(weight) * value for weight, value in zip(row, points, strict=True))
            defects.append(final_time / intervals * ca.vertcat(point[3:], forces) - slope)
        x = points[-1]
    bounds[-1] = (end, end)
    nlp = {"x": ca.vertcat(*variables), "f": final_time, "g": ca.vertcat(*defects)}
    options = {"expand": True, "print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-10}}
    lower, upper = (np.concatenate(side) for side in zip(*bounds, strict=True))
    solver = ca.nlpsol("cops", "ipopt", nlp, options)
    result = solver(x0=np.concatenate(guess), lbx=lower, ubx=upper, lbg=0, ubg=0)
    assert solver.stats()["success"]
    return float(result["f"])


def test_cops_robot_arm():
    """The switches of its bang-bang controls fall inside intervals: the time comes down to the optimum."""
    excess = [robot_arm_of_cops(N, degree=2) / COPS_FINAL_TIME - 1 for N in (25, 50, 100, 200)]
    assert excess == sorted(excess, reverse=True)
    assert 0 < excess[-1] < 3e-6


@lru_cache(maxsize=1)
def given_design() -> np.ndarray:
    return solve(paper_problem(0.4, 1.0, "energy")).design


def solved_on(kind: str, scheme: str, degree: int, intervals: int) -> Solution:
    transcription = Transcription(scheme, degree, intervals, "current")
    problem = replace(paper_problem(0.4, 1.0, kind, transcription=transcription), design=given_design())
    solution = solve(problem, options=TIGHT)
    assert solution.success
    return solution


def optimum(kind: str, scheme: str, degree: int, intervals: int) -> float:
    return solved_on(kind, scheme, degree, intervals).objective


def test_radau_and_legendre_meet_as_the_grid_is_refined():
    """Effort over one second at a given design, degree 3: apart by 1.3e-3, 1.7e-4 and 3.7e-5."""
    apart = []
    for intervals in (10, 20, 40):
        radau, legendre = (optimum("energy", scheme, 3, intervals) for scheme in ("radau", "legendre"))
        apart.append(abs(radau - legendre) / radau)
    assert apart[0] > 3 * apart[1] > 9 * apart[2]
    assert apart[2] < 1e-4


def test_minimum_time_settles_at_first_order():
    """Currents that are linear need an interval to switch: the time lost is a part of an interval's width.

    Observed 1.14 and 1.11 between 20, 40, 80 and 160 intervals.
    """
    times = [optimum("time", "radau", 2, intervals) for intervals in (20, 40, 80, 160)]
    lost = -np.diff(times)
    assert (lost > 0).all()
    assert np.log2(lost[:-1] / lost[1:]) == pytest.approx(np.ones(2), abs=0.25)


def test_the_motion_of_least_effort_settles_too():
    """Joint positions at twenty times, each grid against the next: 0.13, 0.070 and 0.019 rad apart.

    Where limits begin and cease to bind falls inside intervals, as with minimum times: first order and a little more.
    """
    motions = [solved_on("energy", "radau", 3, N).motion.position[:: 3 * N // 20] for N in (20, 40, 80, 160)]
    apart = [np.abs(coarse - fine).max() for coarse, fine in pairwise(motions)]
    assert apart[0] > apart[1] > apart[2]
    assert np.log2(apart[0] / apart[2]) / 2 > 1
