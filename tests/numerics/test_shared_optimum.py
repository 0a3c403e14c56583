"""The best single design: optimal for the joint program, and better than every other design tried."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from services.codesign.comparison import over_tasks
from services.codesign.guess import Guess, point_guess
from services.codesign.instance import Instance, build_instance
from services.codesign.optimality import optimality
from services.codesign.problem import Objective, Problem, Task, Transcription
from services.codesign.program import Program, load_program, program_of
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

BARRIER_LOSS = 5e-4
"""Relative: the joint solve keeps its barrier parameter at 1e-7, which counts once for each of the many bounds."""

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


def objectives(problems: list[Problem], design: np.ndarray) -> list[float]:
    """The tasks' optima at a given design."""
    found = [solve(replace(p, design=design)).objective for p in problems]
    assert None not in found
    return [value for value in found if value is not None]


def total(problems: list[Problem], design: np.ndarray) -> float:
    """Their sum."""
    return sum(objectives(problems, design))


def test_it_is_feasible_and_at_an_optimum_of_the_joint_program(study: Study) -> None:
    assert study.shared.success
    assert study.shared.optimality.kkt_residual < 1e-6
    assert study.shared.optimality.constraint_violation < 2e-6
    assert study.shared.design is not None
    assert max(violation(row, study.problems[0].motor) for row in study.shared.design) < 1e-6


def test_each_task_alone_confirms_its_total(study: Study) -> None:
    assert study.shared.design is not None
    alone = total(study.problems, study.shared.design)
    assert alone < study.shared.objective * (1 + SAME_OPTIMUM)
    assert alone > study.shared.objective * (1 - BARRIER_LOSS)


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
    assert found.reached.shape == study.mean.shape
    assert 1e-4 < np.abs(found.reached / study.mean - 1).max() < 10


def test_the_worst_task_gains_when_it_alone_counts(study: Study) -> None:
    """Against the sum's design; and what decides is the worst task, which another solve with that design confirms."""
    start = start_at(study.mean, study.own)
    found = solve_shared(study.problems, [1.0] * 3, start, SolverOptions(), worst_share=1.0)
    assert found.design is not None
    assert study.shared.design is not None
    assert found.optimality.kkt_residual < 1e-6
    times = objectives(study.problems, found.design)
    before = objectives(study.problems, study.shared.design)
    assert max(times) < max(before) * 0.999
    assert sum(times) > sum(before)
    assert found.deciding[int(np.argmax(times))] == pytest.approx(1.0, abs=1e-2)
    assert found.objective == pytest.approx(over_tasks(times, [1.0] * 3, worst_share=1.0), rel=SAME_OPTIMUM)


@pytest.mark.parametrize(("worst_share", "reached"), [(0.0, 1e-6), (0.5, 1e-5)])
def test_each_motion_is_at_an_optimum_of_its_own_task(study: Study, worst_share: float, reached: float) -> None:
    """With the design given: by the residuals of the task's own program, before any solve, and by a solve from there.

    Where the worst task counts, another task's multipliers are found with what is left of the weight.
    """
    weights = [1.0, 5.0, 2.0]
    start = start_at(study.mean, study.own)
    found = solve_shared(study.problems, weights, start, SolverOptions(), worst_share=worst_share)
    values = []
    for asked, point in zip(study.problems, found.motions, strict=True):
        given = replace(asked, design=found.design)
        program = program_of(given)
        instance, guess = build_instance(given, program), point_guess(given, program, point)
        assert guess.lam_x is not None
        assert guess.lam_g is not None
        lam_x = guess.lam_x.copy()
        lam_x[: program.design_size] = -slope(program, instance, guess)[: program.design_size]  # the pinned design's
        at = optimality(program, instance, guess.x, lam_x, guess.lam_g)
        assert at.kkt_residual < reached
        assert at.constraint_violation < reached
        solution = solve(given, guess)
        assert [attempt.name for attempt in solution.attempts] == ["given start"]
        assert solution.objective is not None
        values.append(solution.objective)
    assert over_tasks(values, weights, worst_share) <= found.objective * (1 + 1e-6)


def slope(program: Program, instance: Instance, point: Guess) -> np.ndarray:
    """Slope of the objective and the constraints, these with their multipliers, in each variable."""
    _, gradient = program.grad_f(point.x, instance.parameters)
    _, jacobian = program.jac_g(point.x, instance.parameters)
    found: np.ndarray = (gradient + jacobian.T @ point.lam_g).full().ravel()
    return found


def test_a_motion_is_no_start_for_a_free_design(study: Study) -> None:
    program = program_of(study.problems[0])
    with pytest.raises(ValueError, match="given design"):
        point_guess(study.problems[0], program, study.shared.motions[0])


def test_tasks_that_are_alike_decide_together(study: Study) -> None:
    """The slowest task twice: its two copies share the worst objective's weight."""
    problems = [study.problems[2], study.problems[0], study.problems[2]]
    own = [study.own[2], study.own[0], study.own[2]]
    found = solve_shared(problems, [1.0, 5.0, 1.0], start_at(study.mean, own), SolverOptions(), worst_share=0.5)
    assert found.success
    assert sum(found.deciding) == pytest.approx(1.0)
    assert found.deciding[0] == pytest.approx(found.deciding[2], abs=0.02)
    assert found.deciding[1] == pytest.approx(0.0, abs=1e-3)


def test_energies_have_a_worst_task_too() -> None:
    """The objective is then a sum over the whole motion, and so is its constraint."""
    problems = [problem(stroke, payload, objective=Objective("energy")) for stroke, payload in ((0.3, 0.0), (0.8, 2.0))]
    own = [solve(p) for p in problems]
    assert own[1].design is not None
    start = start_at(own[1].design, own)
    total = solve_shared(problems, [1.0, 1.0], start, SolverOptions())
    worst = solve_shared(problems, [1.0, 1.0], start, SolverOptions(), worst_share=1.0)
    assert total.design is not None
    assert worst.design is not None
    assert worst.optimality.kkt_residual < 1e-6
    assert max(objectives(problems, worst.design)) < max(objectives(problems, total.design))


def test_two_threads_give_the_answer_of_one(study: Study) -> None:
    """The same functions of the same numbers: not a bit of difference."""
    found = solve_shared(study.problems, [1.0] * 3, start_at(study.mean, study.own), SolverOptions(threads=2))
    assert found.design is not None
    assert study.shared.design is not None
    np.testing.assert_array_equal(found.design, study.shared.design)


@pytest.mark.parametrize("kind", ["time", "energy"])
@pytest.mark.parametrize("control", ["voltage", "current"])
def test_derivatives_with_a_worst_task(kind: str, control: str) -> None:
    """Against differences, along a random direction at a random point with random multipliers."""
    transcription = Transcription("radau", 1, 4) if control == "voltage" else Transcription("radau", 3, 4, control)
    problems = [problem(stroke, 1.0, objective=Objective(kind), transcription=transcription) for stroke in (0.3, 0.7)]
    task = load_program(UR5, problems[0].layout, 4)
    program = build_shared_program(task, 2, has_worst=True)
    instance = program.instance([build_instance(p, task) for p in problems], [0.3, 0.7], 0.6)
    p, generator = instance.parameters, np.random.default_rng(3)
    x = 0.5 + 0.1 * generator.standard_normal(program.variables)
    step, lam = generator.standard_normal(program.variables), generator.standard_normal(program.constraints)

    def slope(at: np.ndarray) -> np.ndarray:
        gradient: np.ndarray = (program.grad_f(at, p)[1] + program.jac_g(at, p)[1].T @ lam).full().ravel()
        return gradient

    def lagrangian(at: np.ndarray) -> float:
        f, g = program.nlp(at, p)
        return float(f) + float(lam @ g.full().ravel())

    h = 1e-6
    difference = (lagrangian(x + h * step) - lagrangian(x - h * step)) / (2 * h)
    assert slope(x) @ step == pytest.approx(difference, rel=1e-6)
    upper = program.hess_lag(x, p, 1.0, lam).full()
    curvature = (upper + upper.T - np.diag(np.diag(upper))) @ step
    change = (slope(x + h * step) - slope(x - h * step)) / (2 * h)
    np.testing.assert_allclose(curvature, change, rtol=1e-5, atol=1e-6 * np.abs(change).max())


@pytest.mark.parametrize("kind", ["time", "energy"])
def test_derivatives_are_those_of_the_whole(kind: str) -> None:
    """Against the tasks' programs one by one, at a random point with random multipliers."""
    problems = [problem(0.3, 1.0, objective=Objective(kind)), problem(0.7, 3.0, objective=Objective(kind))]
    task = load_program(UR5, problems[0].layout, COARSE.intervals)
    program = build_shared_program(task, 2)
    parts = [build_instance(p, task) for p in problems]
    instance = program.instance(parts, [1.0, 1.0], 0.0)
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
@pytest.mark.parametrize("has_worst", [False, True])
def test_every_unknown_is_eliminated_once(kind: str, has_worst: bool) -> None:
    problems = [problem(0.3, 1.0, objective=Objective(kind)), problem(0.7, 3.0, objective=Objective(kind))]
    task = load_program(UR5, problems[0].layout, COARSE.intervals)
    program = build_shared_program(task, 2, has_worst=has_worst)
    instance = program.instance([build_instance(p, task) for p in problems], [1.0, 1.0], 0.0)
    order = shared_elimination(program, instance)
    free, inequalities = instance.lower_x != instance.upper_x, instance.lower_g != instance.upper_g
    unknowns = int(free.sum() + inequalities.sum()) + program.constraints
    assert sorted(order.order) == list(range(unknowns))
    assert order.first[-1] == unknowns
