"""Of designs that are equal within a tolerance, the one asked for: against the optimum, and against other solves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from services.codesign import accuracy as accuracy_module
from services.codesign import kernels as kernels_module
from services.codesign.accuracy import solve_accurately
from services.codesign.elimination import Elimination
from services.codesign.freedom import Freedom, FreeGear, TieBreak
from services.codesign.instance import build_instance, scales_of
from services.codesign.limits import limit_slopes
from services.codesign.motor import evaluate_motor
from services.codesign.motor_data import MotorData
from services.codesign.problem import Accuracy, Objective, Problem, Task, Transcription
from services.codesign.program import build_program
from services.codesign.reconcile import violation
from services.codesign.robot import Robot
from services.codesign.shared_optimum import SharedStart, solve_shared
from services.codesign.solve import Solution, solve
from services.codesign.solver import SolverOptions
from services.codesign.tie_break_program import tie_break_elimination, tie_break_program
from tests.numerics.derivatives import assert_derivatives_of_the_whole
from tests.numerics.test_freedom import SMALL, small, ur5

ROUNDING = 1e-9
TOLERANCE = 1e-3
"""Given up of the objective."""

SOLVER = 2e-5
"""Relative: how far a constraint of order 0.1 may be missed at IPOPT's tolerance of 1e-6."""


def mass_of(design: np.ndarray) -> float:
    """Of all motors [kg]."""
    return sum(evaluate_motor(row, MotorData())[1]["mass_kg"] for row in design)


def mass(solution: Solution) -> float:
    return mass_of(solution.design)


def broken(problem: Problem, **tie_break: object) -> Solution:
    return solve(replace(problem, tie_break=TieBreak(**{"tolerance": TOLERANCE, **tie_break})))


@pytest.mark.parametrize("kind", ["time", "energy"])
@pytest.mark.parametrize("control", ["voltage", "current"])
def test_derivatives_equal_those_of_the_whole(kind: str, control: str) -> None:
    freedom = Freedom((FreeGear(1, 10.0, 300.0),), ((0, 1),))
    problem = small(freedom, Transcription("radau", 2, 3, control), kind)
    kernels = kernels_module._virtual_machine(SMALL, problem.layout)
    program = build_program(kernels, problem.layout, 3, problem.motor_of)
    second = tie_break_program(program)
    rng = np.random.default_rng(0)
    x = rng.uniform(0.9, 1.1, program.variables)
    x[program.time_index] = 0.6
    p = second.instance(build_instance(problem, program), 1.0, rng.uniform(0.8, 1.2, (2, 7))).parameters
    p[-program.lengths - 2 : -program.lengths] = 0.4, 0.7  # both objectives at once
    assert_derivatives_of_the_whole(second, x, p, rng.normal(size=second.constraints), ROUNDING)


def test_the_mass_counts_every_joint() -> None:
    """Two joints with one motor weigh twice that motor."""
    problem = small(Freedom((), ((0, 1),)), Transcription("radau", 1, 3))
    kernels = kernels_module._virtual_machine(SMALL, problem.layout)
    program = build_program(kernels, problem.layout, 3, problem.motor_of)
    second = tie_break_program(program)
    instance = second.instance(build_instance(problem, program), 1.0, None)
    x = np.random.default_rng(0).uniform(0.9, 1.1, program.variables)
    one = evaluate_motor(x[:7] * scales_of(problem).design, problem.motor)[1]["mass_kg"]
    assert float(second.nlp(x, instance.parameters)[0]) == pytest.approx(2 * one, rel=1e-12)


@pytest.mark.parametrize("kind", ["time", "energy"])
def test_the_lightest_design_within_the_tolerance(kind: str) -> None:
    plain, light = solve(ur5(kind=kind)), broken(ur5(kind=kind))
    assert light.attempts[-1].name == "tie-break: lightest"
    assert light.attempts[-1].linear_solver == "staged"
    assert mass(light) < 0.95 * mass(plain)
    assert light.objective <= plain.objective * (1 + TOLERANCE + SOLVER)
    assert max(violation(row, light.problem.motor) for row in light.design) < 1e-6
    again = solve(replace(ur5(kind=kind), design=light.design))
    assert again.objective == pytest.approx(light.objective, rel=SOLVER)


def test_multipliers_are_still_slopes_of_the_objective() -> None:
    """With hardly anything given up, what limits cost is what it is at the optimum."""
    plain, light = solve(ur5()), broken(ur5(), tolerance=1e-5)
    before, after = (limit_slopes(s.problem, s.lam_x, s.lam_g) for s in (plain, light))
    for name in ("current_limit_A", "rotor_speed_limit_rad_s"):
        assert before[name].slope < 0
        assert after[name].slope == pytest.approx(before[name].slope, rel=0.1)


def test_more_tolerance_makes_it_lighter() -> None:
    assert mass(broken(ur5(), tolerance=1e-2)) < 0.99 * mass(broken(ur5(), tolerance=1e-4))


def test_the_nearest_design_is_nearer_than_the_lightest() -> None:
    plain, other = solve(ur5()), solve(ur5(0.4, 4.0)).design
    near = broken(ur5(), nearest_to=other)

    def distance(solution: Solution) -> float:
        return float(((solution.design / other - 1) ** 2).sum())

    assert distance(near) < distance(plain)
    assert distance(near) < distance(broken(ur5()))
    assert near.objective <= plain.objective * (1 + TOLERANCE + SOLVER)


def test_the_same_design_from_wherever_the_search_begins() -> None:
    """What is chosen does not depend on the start, where the optimum's free lengths do."""
    starts = [None, solve(ur5(0.2, 0.0)).start, solve(ur5(1.0, 4.0)).start]
    problem = replace(ur5(), tie_break=TieBreak(TOLERANCE))
    chosen = np.array([solve(problem, start).design for start in starts])
    assert np.ptp(chosen / chosen[0], axis=0).max() < 0.02


def test_a_given_design_has_no_tie_and_references_none_either() -> None:
    plain = solve(ur5())
    given = solve(replace(ur5(), design=plain.design, tie_break=TieBreak()))
    assert [attempt.name for attempt in given.attempts] == ["quintic"]
    weighted = solve(replace(ur5(), objective=Objective("weighted", 0.5), tie_break=TieBreak()))
    names = [attempt.name for attempt in weighted.attempts]
    assert names == ["references: quintic", "given start", "tie-break: lightest"]


def test_every_unknown_is_eliminated_once() -> None:
    problem = ur5()
    kernels = kernels_module.load_kernels(problem.robot, problem.layout)
    program = build_program(kernels, problem.layout, 10)
    second = tie_break_program(program)
    instance = second.instance(build_instance(problem, program), 1.0, None)
    order: Elimination = tie_break_elimination(second, instance)
    free, inequalities = instance.lower_x != instance.upper_x, instance.lower_g != instance.upper_g
    assert sorted(order.order) == list(range(int(free.sum() + inequalities.sum()) + second.constraints))


def test_the_shared_optimum_has_one_too() -> None:
    """Lighter at nearly the same total, which the tasks solved again confirm."""
    problems = [ur5(0.2, 4.0), ur5(1.0, 0.0)]
    own = [solve(problem) for problem in problems]
    start = SharedStart(own[1].design, [s.motion for s in own])
    found = {}
    choices = {"plain": None, "light": TieBreak(TOLERANCE), "near": TieBreak(TOLERANCE, own[0].design)}
    for name, tie_break in choices.items():
        asked = [replace(problem, tie_break=tie_break) for problem in problems]
        found[name] = solve_shared(asked, [1.0, 1.0], start, SolverOptions())
        assert found[name].success
        assert found[name].optimality.kkt_residual < 1e-6
    masses = {
        name: sum(evaluate_motor(row, MotorData())[1]["mass_kg"] for row in f.design) for name, f in found.items()
    }
    assert masses["light"] < 0.95 * masses["plain"]
    distances = {name: float(((f.design / own[0].design - 1) ** 2).sum()) for name, f in found.items()}
    assert distances["near"] < 0.9 * min(distances["plain"], distances["light"])
    totals = [sum(solve(replace(p, design=f.design)).objective for p in problems) for f in found.values()]
    assert max(totals) < min(totals) * (1 + 2 * TOLERANCE)
    assert len(found["light"].convergence) == len(found["plain"].convergence)


def test_a_motion_that_misses_its_accuracy_is_solved_without_it(monkeypatch) -> None:
    """A move whose optimum keeps the accuracy on the second grid; its lightest design does not, nor on the fifth."""
    monkeypatch.setattr(accuracy_module, "MOST_REFINEMENTS", 1)
    start, end = np.array([-0.9, -1.1, 1.4, -0.3, -1.57, 0.5]), np.array([1.2, -0.5, 1.1, -0.6, -1.57, 0.0])
    problem = Problem(Robot.preset("ur5"), Task(start, end, 1.8), tie_break=TieBreak(tolerance=1e-4))
    found = solve_accurately(problem, Accuracy(), SolverOptions())
    names = [attempt.name for attempt in found.solution.attempts]
    assert found.met
    assert found.certificate is not None
    assert found.certificate.meets(Accuracy())
    assert found.solution.problem.tie_break is None
    without = "without the tie-break: "
    assert [name.removeprefix(without) for name in names if name.startswith(without)] == [
        "quintic",
        "refined to 60 intervals of degree 3: given start",
    ]
    assert names[-1].startswith(without)
    assert found.solution.iterations == sum(attempt.iterations for attempt in found.solution.attempts)
