"""The paper's formulation, kept as a yardstick (`test_against_baseline.py`): what one would write first, and wait for.

Explicit dynamics (the articulated-body algorithm in the defects), the whole program expanded into scalar operations
and differentiated by CasADi, a straight line as the start, IPOPT with MUMPS as they come.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from services.codesign.instance import build_instance, scales_of
from services.codesign.interval import IntervalExpressions, interval_expressions, unpack_parameters
from services.codesign.motor import design_constraints
from services.codesign.motor_data import DIMENSIONS
from services.codesign.problem import Problem
from services.codesign.program import Program, load_program

START_TIME = 1.0
"""t_f [s] of the straight line."""


@dataclass(frozen=True)
class Run:
    """One call of IPOPT."""

    seconds: float  # CPU, of the solve alone
    build_seconds: float  # CPU, for CasADi to differentiate the program
    iterations: int
    success: bool
    objective: float
    x: np.ndarray


class Baseline:
    """The paper's program of one robot, written out once."""

    def __init__(self, problem: Problem) -> None:
        # Sizes, bounds and parameters are those of our program: only the dynamics in the defects differ.
        self._program = load_program(problem.robot, problem.layout, problem.transcription.intervals)
        layout = replace(self._program.layout, dynamics="forward")
        self._nlp = _expanded(self._program, interval_expressions(problem.robot, layout))

    def solve(self, problem: Problem, tol: float, start: np.ndarray | None = None) -> Run:
        """Solve from the straight line, or from a point."""
        instance = build_instance(problem, self._program)
        began = time.process_time()
        solver = ca.nlpsol("baseline", "ipopt", self._nlp, _options(tol))
        built = time.process_time() - began
        x0 = self._straight_line(problem) if start is None else start
        began = time.process_time()
        result = solver(
            x0=x0,
            p=instance.parameters,
            lbx=instance.lower_x,
            ubx=instance.upper_x,
            lbg=instance.lower_g,
            ubg=instance.upper_g,
        )
        seconds, stats = time.process_time() - began, solver.stats()
        x = result["x"].full().ravel()
        return Run(seconds, built, int(stats["iter_count"]), bool(stats["success"]), float(result["f"]), x)

    def _straight_line(self, problem: Problem) -> np.ndarray:
        """From start to end at constant speed, design at the middle of its bounds, currents and voltages zero."""
        program, scales, motor = self._program, scales_of(problem), problem.motor
        share = (np.arange(program.intervals) + 1)[:, None] / program.intervals
        q = problem.task.start + share * (problem.task.end - problem.task.start)
        intervals = np.zeros((program.intervals, program.layout.variables))
        n = problem.robot.joints
        intervals[:, :n] = q
        intervals[:, n : 2 * n] = (problem.task.end - problem.task.start) / START_TIME / scales.speed
        design = np.tile((motor.lower + motor.upper) / 2 / scales.design, (n, 1))
        return program.join(design, START_TIME, intervals)


def _options(tol: float) -> dict[str, object]:
    return {"print_time": False, "error_on_fail": False, "ipopt": {"tol": tol, "print_level": 0, "sb": "yes"}}


def _expanded(program: Program, e: IntervalExpressions) -> dict[str, ca.SX]:
    """Every interval written out in scalars; p as `Program` has it."""
    n, N, layout = program.layout.joints, program.intervals, program.layout
    interval = ca.Function(
        "interval",
        [e.start, e.variables, e.design, e.final_time, e.width, e.parameters],
        [e.constraints, e.effort],
    )
    x, p = ca.SX.sym("x", program.variables), ca.SX.sym("p", program.nlp.size1_in(1))
    kernel_size, design_size = e.parameters.shape[0], program.design_size
    parameters, start = p[:kernel_size], p[kernel_size : kernel_size + layout.state_size]
    widths = p[kernel_size + layout.state_size : -2]
    design, final_time = x[:design_size], x[design_size]
    constraints, effort = [], ca.SX(0)
    for w in range(N):
        first = design_size + 1 + w * layout.variables
        variables = x[first : first + layout.variables]
        g, cost = interval(start, variables, design, final_time, widths[w], parameters)
        constraints.append(g)
        effort = effort + cost
        start = variables[layout.end_state]
    named, size = unpack_parameters(parameters, n), len(DIMENSIONS)
    for k in range(n):
        lengths = design[size * k : size * (k + 1)] * named["design_scale"]
        constraints.append(design_constraints(lengths, named["coefficients"]))
    return {"x": x, "p": p, "f": p[-2] * final_time + p[-1] * effort, "g": ca.vertcat(*constraints)}
