"""The central path in two parts: its beginning on one grid, its end on another."""

from __future__ import annotations

import numpy as np
import pytest

from services.codesign.guess import motion_guess, quintic_guess, starting_design
from services.codesign.instance import build_instance, scales_of
from services.codesign.motion import read_motion
from services.codesign.program import program_of
from services.codesign.solver import BEGINNING_ENDS, CentralPath, SolverOptions, run
from tests.numerics.tasks import paper_problem

FINE = SolverOptions(tol=1e-8)


@pytest.fixture(scope="module")
def whole():
    """Problem, program, instance, start, and where the whole path ends."""
    problem = paper_problem(0.6, 2.0)
    program = program_of(problem)
    instance = build_instance(problem, program)
    start = quintic_guess(problem, program, instance, starting_design(problem))
    return problem, program, instance, start, run(program, instance, start, FINE)


def test_the_beginning_ends_inside(whole):
    """A bound's multiplier times its distance is about the barrier parameter, and the objective above the optimum."""
    _, program, instance, start, end = whole
    beginning = run(program, instance, start, FINE, path=CentralPath.BEGINNING)
    assert beginning.success
    assert beginning.iterations < end.iterations / 2
    assert end.objective * (1 + 1e-2) < beginning.objective < end.objective * (1 + 3e-1)
    x, lam = beginning.x[: program.design_size], beginning.lam_x[: program.design_size]
    distance = np.where(lam > 0, instance.upper_x[: len(x)] - x, x - instance.lower_x[: len(x)])
    active = np.abs(lam) > 10 * BEGINNING_ENDS
    assert active.any()
    products = (np.abs(lam) * distance)[active] / BEGINNING_ENDS
    assert 1 / 3 < np.median(products) < 3


def test_the_end_goes_on_from_there(whole):
    """On the same grid it ends no higher than the whole path, in fewer iterations."""
    problem, program, instance, start, end = whole
    beginning = run(program, instance, start, FINE, path=CentralPath.BEGINNING)
    design, _, _ = program.split(beginning.x)
    motion = read_motion(problem, program, beginning.x)
    there = motion_guess(problem, program, instance, design * scales_of(problem).design, motion)
    rest = run(program, instance, there, FINE, path=CentralPath.END)
    assert rest.success
    assert rest.iterations < end.iterations
    assert rest.objective < end.objective * (1 + 1e-4)
