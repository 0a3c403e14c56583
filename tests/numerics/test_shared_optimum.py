"""The best single design: optimal for the joint program, and better than every other design tried."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from services.codesign.instance import build_instance
from services.codesign.problem import Objective, Problem, Task, Transcription
from services.codesign.program import load_program
from services.codesign.reconcile import mean_design, project_design, violation
from services.codesign.robot import Robot
from services.codesign.shared_elimination import shared_elimination
from services.codesign.shared_optimum import SharedOptimum, SharedStart, solve_shared
from services.codesign.shared_program import build_shared_program
from services.codesign.solution import Solution
from services.codesign.solve import solve
from services.codesign.solver import STOPPED, SolverOptions

UR5 = Robot.preset("ur5")
COARSE = Transcription(intervals=10)
"""Coarse: what is tested does not depend on accuracy."""

SAME_OPTIMUM = 1e-4
"""Relative: two solves of tolerance 1e-6 that end in the same optimum."""

DERIVATIVE_TOLERANCE = 1e-9
"""Relative: the gathered derivatives are the tasks' own, but for the order of additions."""


def problem(stroke: float, payload: float, **changes: object) -> Problem:
    """One task of the paper's kind."""
    task = Task(np.full(6, stroke), np.zeros(6), payload, duration=1.0)
    return replace(Problem(UR5, task, transcription=COARSE), **changes)  # type: ignore[arg-type]


class Study(NamedTuple):
    """Three unlike tasks, solved every way."""

    problems: list[Problem]
    own: list[Solution]
    mean: np.ndarray
    shared: SharedOptimum


@pytest.fixture(scope="module")
def study() -> Study:
    problems = [problem(0.2, 4.0), problem(0.6, 2.0), problem(1.0, 0.0)]
    own = [solve(p) for p in problems]
    designs = [s.design for s in own if s.design is not None]
    mean = project_design(mean_design(designs), problems[0].motor).design
    return Study(problems, own, mean, solve_shared(problems, [1.0] * 3, start_at(mean, own), SolverOptions()))


def start_at(design: np.ndarray, solutions: list[Solution]) -> SharedStart:
    """A design with the motions of solved tasks."""
    return SharedStart(design, [s.motion for s in solutions if s.motion is not None])


def total(problems: list[Problem], design: np.ndarray) -> float:
    """Sum of the optima at a given design."""
    solutions = [solve(replace(p, design=design)) for p in problems]
    assert all(s.success for s in solutions)
    return sum(s.objective for s in solutions if s.objective is not None)


def test_it_is_feasible_and_at_an_optimum_of_the_joint_program(study: Study) -> None:
    assert study.shared.success
    assert study.shared.optimality.kkt_residual < 1e-6
    assert study.shared.optimality.constraint_violation < 2e-6
    assert study.shared.design is not None
    assert max(violation(row, study.problems[0].motor) for row in study.shared.design) < 1e-6


def test_each_task_alone_confirms_its_total(study: Study) -> None:
    assert study.shared.design is not None
    assert total(study.problems, study.shared.design) == pytest.approx(study.shared.objective, rel=SAME_OPTIMUM)


def test_it_lies_between_the_own_optima_and_every_single_design(study: Study) -> None:
    bound = sum(s.objective for s in study.own if s.objective is not None)
    designs = [study.mean, *(s.design for s in study.own if s.design is not None)]
    assert bound < study.shared.objective
    assert study.shared.objective < min(total(study.problems, design) for design in designs) * (1 + 1e-6)


def test_no_small_step_in_the_design_is_better(study: Study) -> None:
    """An independent look at optimality: projected random steps around the design raise the total."""
    assert study.shared.design is not None
    generator = np.random.default_rng(7)
    for _ in range(4):
        step = 1 + 0.02 * generator.standard_normal(study.shared.design.shape)
        nearby = project_design(study.shared.design * step, study.problems[0].motor).design
        assert total(study.problems, nearby) > study.shared.objective * (1 - SAME_OPTIMUM)


def test_one_task_alone_gets_its_own_optimum(study: Study) -> None:
    single = study.problems[1:2]
    found = solve_shared(single, [3.0], start_at(study.mean, study.own[1:2]), SolverOptions())
    assert study.own[1].objective is not None
    assert found.objective == pytest.approx(3.0 * study.own[1].objective, rel=1e-3)


def test_weights_pull_the_design_towards_a_task(study: Study) -> None:
    weights = [100.0, 1.0, 1.0]
    pulled = solve_shared(study.problems, weights, start_at(study.mean, study.own), SolverOptions())
    assert pulled.design is not None
    assert study.shared.design is not None
    first = study.problems[:1]
    assert total(first, pulled.design) < total(first, study.shared.design)


def test_it_can_be_stopped(study: Study) -> None:
    found = solve_shared(
        study.problems,
        [1.0] * 3,
        start_at(study.mean, study.own),
        SolverOptions(),
        lambda report: report.iteration >= 3,
    )
    assert (found.success, found.status, found.design) == (False, STOPPED, None)
    assert [iteration for iteration, _ in found.convergence] == [0, 1, 2, 3]


@pytest.mark.parametrize("kind", ["time", "energy"])
def test_derivatives_are_those_of_the_whole(kind: str) -> None:
    """Against the tasks' programs one by one, at a random point with random multipliers."""
    problems = [problem(0.3, 1.0, objective=Objective(kind)), problem(0.7, 3.0, objective=Objective(kind))]
    task = load_program(UR5, problems[0].layout, COARSE.intervals)
    program = build_shared_program(task, 2)
    parts = [build_instance(p, task) for p in problems]
    instance = program.instance(parts)
    generator = np.random.default_rng(1)
    x = np.clip(0.5 + 0.1 * generator.standard_normal(program.variables), 0.2, 0.8)
    lam = generator.standard_normal(program.constraints)
    f, gradient = (value.full().ravel() for value in program.grad_f(x, instance.parameters))
    g, jacobian = (value.full() for value in program.jac_g(x, instance.parameters))
    hessian = program.hess_lag(x, instance.parameters, 1.0, lam).full()

    values, slopes, curvature = 0.0, np.zeros(program.variables), np.zeros((program.variables, program.variables))
    for k, part in enumerate(parts):
        at, rows = program.variables_of(k), program.constraints_of(k)
        task_f, task_gradient = (value.full().ravel() for value in task.grad_f(x[at], part.parameters))
        task_g, task_jacobian = (value.full() for value in task.jac_g(x[at], part.parameters))
        values += task_f[0]
        slopes[at] += task_gradient
        np.testing.assert_allclose(g[rows], task_g, rtol=DERIVATIVE_TOLERANCE, atol=1e-12)
        np.testing.assert_allclose(jacobian[np.ix_(rows, at)], task_jacobian, rtol=DERIVATIVE_TOLERANCE, atol=1e-12)
        mine = lam[rows].copy()
        if k > 0:
            mine[-36:] = 0  # the motors' constraints count once
        upper = task.hess_lag(x[at], part.parameters, 1.0, mine).full()
        curvature[np.ix_(at, at)] += upper + upper.T - np.diag(np.diag(upper))
    assert f[0] == pytest.approx(values)
    np.testing.assert_allclose(gradient, slopes, rtol=DERIVATIVE_TOLERANCE, atol=1e-12)
    whole = hessian + hessian.T - np.diag(np.diag(hessian))
    np.testing.assert_allclose(whole, curvature, rtol=DERIVATIVE_TOLERANCE, atol=1e-9)


@pytest.mark.parametrize("kind", ["time", "energy"])
def test_every_unknown_is_eliminated_once(kind: str) -> None:
    problems = [problem(0.3, 1.0, objective=Objective(kind)), problem(0.7, 3.0, objective=Objective(kind))]
    task = load_program(UR5, problems[0].layout, COARSE.intervals)
    program = build_shared_program(task, 2)
    instance = program.instance([build_instance(p, task) for p in problems])
    order = shared_elimination(program, instance)
    free, inequalities = instance.lower_x != instance.upper_x, instance.lower_g != instance.upper_g
    unknowns = int(free.sum() + inequalities.sum()) + program.constraints
    assert sorted(order.order) == list(range(unknowns))
    assert order.first[-1] == unknowns
