"""The same optimum from a solver of another kind: Fatrop, a structured interior point method, inside CasADi.

Its problem is laid out anew, stage by stage, with CasADi's derivatives: the states carried are the arm's, the design
and t_f; the controls of a stage are all variables of its interval.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from services.codesign.guess import quintic_guess, starting_design
from services.codesign.instance import build_instance, objective_weights
from services.codesign.interval import interval_expressions, parameter_sizes
from services.codesign.motor import constraint_limits, design_constraints
from services.codesign.motor_data import COEFFICIENTS
from services.codesign.problem import Problem, Transcription
from services.codesign.program import load_program
from services.codesign.solver import SolverOptions, run
from tests.numerics.tasks import paper_problem

SAME = 1e-6
"""Relative; both solvers at tol 1e-8."""

COARSE = {"voltage": Transcription("radau", 1, 8), "current": Transcription("radau", 2, 8, "current")}


class Stages:
    """An NLP with variables [s_0, v_0, s_1, v_1, ..., s_N] and its constraints in the order of the stages."""

    def __init__(self) -> None:
        self.x: list[Any] = []
        self.bounds_x: list[tuple[np.ndarray, np.ndarray]] = []
        self.start: list[np.ndarray] = []
        self.g: list[Any] = []
        self.bounds_g: list[tuple[np.ndarray, np.ndarray]] = []
        self.equality: list[bool] = []
        self.f: Any = 0

    def variable(self, symbol: Any, low: np.ndarray, high: np.ndarray, start: np.ndarray) -> None:
        self.x.append(symbol)
        self.bounds_x.append((low, high))
        self.start.append(start)

    def constraint(self, g: Any, low: np.ndarray, high: np.ndarray, equality: bool) -> None:
        self.g.append(g)
        self.bounds_g.append((low, high))
        self.equality += [equality] * len(low)

    def solve(self) -> float:
        options = {
            "structure_detection": "auto",
            "equality": self.equality,
            "expand": True,
            "print_time": False,
            "fatrop": {"tol": 1e-8, "max_iter": 500, "print_level": 0},
        }
        nlp = {"x": ca.vertcat(*self.x), "f": self.f, "g": ca.vertcat(*self.g)}
        solver = ca.nlpsol("solver", "fatrop", nlp, options)
        (lbx, ubx), (lbg, ubg) = (
            [np.concatenate(side) for side in zip(*bounds, strict=True)] for bounds in (self.bounds_x, self.bounds_g)
        )
        result = solver(x0=np.concatenate(self.start), lbx=lbx, ubx=ubx, lbg=lbg, ubg=ubg)
        violation = np.maximum(lbg - result["g"].full().ravel(), result["g"].full().ravel() - ubg).max()
        assert violation < 1e-6, "Fatrop's point is not feasible"
        return float(result["f"])


def staged(problem: Problem) -> Stages:
    """Lay out a problem for Fatrop."""
    layout, N, n = problem.layout, problem.transcription.intervals, problem.robot.joints
    program = load_program(problem.robot, layout, N)
    instance = build_instance(problem, program)
    guess = program.split(quintic_guess(problem, program, instance, starting_design(problem)).x)
    low, high = program.split(instance.lower_x), program.split(instance.upper_x)
    sizes = sum(parameter_sizes(n).values())
    parameters = instance.parameters[:sizes]
    first = instance.parameters[sizes : sizes + layout.state_size]
    e = interval_expressions(problem.robot, layout)
    inputs = [e.start, e.variables, e.design, e.final_time, e.width, e.parameters]
    interval = ca.Function("interval", inputs, [e.constraints, e.effort], {"cse": True})
    time_weight, effort_weight = objective_weights(problem)

    stages, carried, far = Stages(), 7 * n + 1, np.full(layout.state_size + 7 * n + 1, np.inf)
    states = [ca.MX.sym(f"s_{k}", layout.state_size + carried) for k in range(N + 1)]
    for k, state in enumerate(states):
        arm, design, final_time = state[: layout.state_size], state[layout.state_size : -1], state[-1]
        here = first if k == 0 else guess[2][k - 1][layout.end_state]
        start = np.concatenate([here, guess[0].ravel(), [guess[1]]])
        if k == 0:
            given = [np.concatenate([first, side[0].ravel(), [side[1]]]) for side in (low, high)]
            stages.variable(state, given[0], given[1], start)
        else:
            stages.variable(state, -far, far, start)
        if k < N:
            control = ca.MX.sym(f"v_{k}", layout.variables)
            stages.variable(control, low[2][k], high[2][k], guess[2][k])
            constraints, effort = interval(arm, control, design, final_time, 1 / N, parameters)
            reached = ca.vertcat(control[layout.end_state], design, final_time)
            nothing = np.zeros(layout.state_size + carried)
            stages.constraint(states[k + 1] - reached, nothing, nothing, equality=True)
            zeros, ones = np.zeros(layout.equalities), np.ones(layout.inequalities)
            stages.constraint(constraints[: layout.equalities], zeros, zeros, equality=True)
            if layout.inequalities:
                stages.constraint(constraints[layout.equalities :], -ones, ones, equality=False)
            stages.f += effort_weight * effort
        if k == 0:
            _motors(problem, stages, design, parameters)
    stages.f += time_weight * states[-1][-1]
    return stages


def _motors(problem: Problem, stages: Stages, design: Any, parameters: np.ndarray) -> None:
    one = ca.SX.sym("one", 7)
    scale, coefficients = parameters[len(COEFFICIENTS) : len(COEFFICIENTS) + 7], parameters[: len(COEFFICIENTS)]
    constraints = ca.Function("motor", [one], [design_constraints(one * scale, ca.DM(coefficients))])
    low, high = constraint_limits(problem.motor)
    for k in range(problem.robot.joints):
        stages.constraint(constraints(design[7 * k : 7 * k + 7]), low, high, equality=False)


@pytest.mark.parametrize(
    ("stroke", "payload", "kind", "control"),
    [(0.2, 0.0, "energy", "voltage"), (0.6, 2.0, "time", "voltage"), (0.2, 0.0, "time", "current")],
)
def test_fatrop_finds_the_same_optimum(stroke, payload, kind, control):
    problem = paper_problem(stroke, payload, kind, transcription=COARSE[control])
    program = load_program(problem.robot, problem.layout, problem.transcription.intervals)
    instance = build_instance(problem, program)
    guess = quintic_guess(problem, program, instance, starting_design(problem))
    outcome = run(program, instance, guess, SolverOptions(tol=1e-8))
    assert outcome.success
    assert staged(problem).solve() == pytest.approx(outcome.objective, rel=SAME)
