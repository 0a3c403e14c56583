"""The parts of a solve one by one, to see which of them a change made slower.

    python -m pytest -o addopts= benchmarks/test_parts.py --benchmark-timer=time.process_time --benchmark-autosave
    ... --benchmark-compare    the same, beside the last that was saved

One task of the paper (0.6 rad, 2 kg), 50 intervals, compiled kernels.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
import pytest

from benchmarks.conftest import PARTS
from benchmarks.solve_time import paper_problem
from services.codesign.certify import certify
from services.codesign.guess import quintic_guess, starting_design
from services.codesign.instance import build_instance
from services.codesign.problem import Problem
from services.codesign.program import program_of
from services.codesign.replay import replay
from services.codesign.solution import Solution
from services.codesign.solve import solve
from services.codesign.voltage_law import voltage_law

pytestmark = pytest.mark.benchmark(group=PARTS)

PROBLEM = paper_problem(0.6, 2.0)


@lru_cache
def solved() -> Solution:
    return solve(PROBLEM)


def bound(function: ca.Function, arguments: list[np.ndarray]) -> Callable[[], None]:
    """A call of a CasADi function whose arguments and results stay in place, as IPOPT's do."""
    buffer: Any
    buffer, call = function.buffer()
    held = [np.ascontiguousarray(argument, dtype=float) for argument in arguments]
    held += [np.zeros(function.nnz_out(k)) for k in range(function.n_out())]
    for k, array in enumerate(held):
        place, index = (buffer.set_arg, k) if k < len(arguments) else (buffer.set_res, k - len(arguments))
        place(index, memoryview(array))

    def evaluate(_kept: Any = (buffer, held)) -> None:
        call()

    return evaluate


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("nlp", "objective and constraints"),
        ("grad_f", "gradient of the objective"),
        ("jac_g", "Jacobian of the constraints"),
        ("hess_lag", "Hessian of the Lagrangian"),
    ],
)
def test_function(benchmark, name, part):
    """Of the whole program."""
    program = program_of(PROBLEM)
    instance, solution = build_instance(PROBLEM, program), solved()
    arguments = [solution.x, instance.parameters]
    if name == "hess_lag":
        arguments += [np.ones(1), solution.lam_g]
    benchmark.extra_info["part"] = part
    benchmark(bound(getattr(program, name), arguments))


def test_guess(benchmark):
    program = program_of(PROBLEM)
    instance, design = build_instance(PROBLEM, program), starting_design(PROBLEM)
    benchmark.extra_info["part"] = "guess"
    benchmark(quintic_guess, PROBLEM, program, instance, design)


def test_replay(benchmark):
    solution = solved()
    law = voltage_law(PROBLEM, solution.design, solution.motion)
    benchmark.extra_info["part"] = "replay"
    benchmark(replay, PROBLEM, solution.design, solution.motion, law)


def test_certificate(benchmark):
    benchmark.extra_info["part"] = "certificate, replay included"
    benchmark(certify, solved())


@pytest.mark.parametrize("kind", ["time", "energy"])
def test_solve(benchmark, kind):
    """From the guess to the answer."""
    problem: Problem = paper_problem(0.6, 2.0, kind)
    benchmark.extra_info["part"] = f"whole solve for {kind}"
    assert benchmark(solve, problem).success
