"""A program's second question: of all points nearly as good as its optimum, the one with the lightest motors.

The program is a task's, or that of all tasks with one design. Variables are those of the program. Its objective f
becomes the last constraint, ``f <= bound``, and what is minimised is the design's mass, or its distance from a given
one. Both come from functions that the program has: the motors' masses are among its constraints, and second derivatives
are the program's own with other multipliers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from services.codesign.elimination import Elimination, elimination, number_unknowns
from services.codesign.instance import Instance
from services.codesign.kept import Kept
from services.codesign.motor_data import CONSTRAINTS
from services.codesign.program import Program
from services.codesign.shared_elimination import shared_elimination
from services.codesign.shared_program import SharedProgram


@dataclass(frozen=True)
class TieBreakProgram:
    """Functions; `p` is the program's, then what a kilogram counts, what a distance counts, and where it is from."""

    base: Program | SharedProgram
    nlp: ca.Function  # (x, p) -> (f, g)
    grad_f: ca.Function  # (x, p) -> (f, gradient)
    jac_g: ca.Function  # (x, p) -> (g, Jacobian)
    hess_lag: ca.Function  # (x, p, lam_f, lam_g) -> upper triangle of the Hessian

    @property
    def variables(self) -> int:
        """Number of variables: the program's."""
        return self.base.variables

    @property
    def constraints(self) -> int:
        """Number of constraints: the program's, and its objective."""
        return self.base.constraints + 1

    def instance(self, base: Instance, bound: float, target: np.ndarray | None) -> Instance:
        """Keep the program's objective up to `bound`; lightest, or nearest to scaled lengths of shape (n, 7)."""
        task = _of_a_task(self.base)
        lengths = np.ones(task.lengths) if target is None else task.join(target, 0.0, np.empty(0))[: task.lengths]
        counts = [1.0, 0.0] if target is None else [0.0, 1.0]
        return Instance(
            parameters=np.concatenate([base.parameters, counts, lengths]),
            lower_x=base.lower_x,
            upper_x=base.upper_x,
            lower_g=np.append(base.lower_g, -np.inf),
            upper_g=np.append(base.upper_g, bound),
        )


MOST_PROGRAMS = 4
"""Kept in a process."""

_PROGRAMS: Kept[TieBreakProgram] = Kept(MOST_PROGRAMS)


def tie_break_program(base: Program | SharedProgram) -> TieBreakProgram:
    """Kept in the process; each keeps its base, and so its id."""
    return _PROGRAMS.get((id(base),), lambda: _build(base))


def _of_a_task(base: Program | SharedProgram) -> Program:
    """The program of one task: lengths stand first in both, and mean the same."""
    return base.task if isinstance(base, SharedProgram) else base


def _build(base: Program | SharedProgram) -> TieBreakProgram:
    x = ca.MX.sym("x", base.variables)
    own, size = base.nlp.numel_in(1), _of_a_task(base).lengths
    p = ca.MX.sym("p", own + 2 + size)
    given, per_mass, per_distance, target = p[:own], p[own], p[own + 1], p[own + 2 :]
    lengths = x[:size]
    f, g = base.nlp(x, given)
    _, gradient = base.grad_f(x, given)
    _, jacobian = base.jac_g(x, given)
    joints = _joints_of_masses(base)
    masses = per_mass * ca.DM(joints)
    second = ca.dot(masses, g) + per_distance * ca.sumsqr(lengths / target - 1)
    pull = ca.vertcat(per_distance * 2 * (lengths / target - 1) / target, ca.DM.zeros(base.variables - size))
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", base.constraints + 1)
    hessian = base.hess_lag(x, given, lam_g[-1], lam_g[:-1] + lam_f * masses)
    diagonal = ca.vertcat(lam_f * per_distance * 2 / target**2, ca.MX(base.variables - size, 1))
    everything = ca.vertcat(jacobian, ca.MX(ca.densify(gradient).T))
    return TieBreakProgram(
        base=base,
        nlp=ca.Function("nlp", [x, p], [second, ca.vertcat(g, f)], ["x", "p"], ["f", "g"]),
        grad_f=ca.Function(
            "nlp_grad_f", [x, p], [second, ca.densify(jacobian.T @ masses) + pull], ["x", "p"], ["f", "grad_f_x"]
        ),
        jac_g=ca.Function("nlp_jac_g", [x, p], [ca.vertcat(g, f), everything], ["x", "p"], ["g", "jac_g_x"]),
        hess_lag=ca.Function(
            "nlp_hess_l",
            [x, p, lam_f, lam_g],
            [ca.triu(hessian + ca.diag(diagonal))],
            ["x", "p", "lam_f", "lam_g"],
            ["triu_hess_gamma_x_x"],
        ),
    )


def _joints_of_masses(base: Program | SharedProgram) -> np.ndarray:
    """For each constraint, how many joints have the motor whose mass it is; 0 for what is no mass."""
    task, joints = _of_a_task(base), np.zeros(base.constraints)
    rows = base.constraints_of(0) if isinstance(base, SharedProgram) else np.arange(base.constraints)
    masses = rows[-task.motor_constraints :].reshape(-1, len(CONSTRAINTS))[:, CONSTRAINTS.index("mass_kg")]
    joints[masses] = np.bincount(task.motor_of)
    return joints


def tie_break_elimination(program: TieBreakProgram, instance: Instance) -> Elimination:
    """The program's own order; what keeps its objective is eliminated last, with the design."""
    base, free, equality = program.base, instance.lower_x != instance.upper_x, instance.lower_g == instance.upper_g
    order = shared_elimination(base, instance) if isinstance(base, SharedProgram) else elimination(base, instance)
    _, slack, multiplier = number_unknowns(free, equality)
    last = np.array([slack[-1], multiplier[-1]], dtype=np.int32)
    end = np.append(order.first[:-1], order.first[-1] + len(last)).astype(np.int32)
    return replace(order, order=np.concatenate([order.order, last]), first=end, multipliers=order.multipliers + 1)
