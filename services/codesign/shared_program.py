"""The program of all tasks with one design: Problem 1 itself, which the paper holds for intractable.

It is the tasks' own programs side by side: variables ``x = [design, motion_0, motion_1, ..., z]`` where a motion
is ``[t_f, interval_0, ..., interval_(N-1)]``; constraints ``g = [intervals of task 0, of task 1, ..., design
constraints, f_0 - z, f_1 - z, ...]`` with the tasks' objectives f_k. The objective is ``a'f + b z``. So z is the worst
task's objective; without a weight on it, z and its constraints are left out. The derivatives are those of a task's
program gathered into place, and nothing is unrolled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from services.codesign.instance import Instance
from services.codesign.program import Program, scatter


@dataclass(frozen=True)
class SharedProgram:
    """Functions and index sets; `p` lists the parameters of the tasks, one after the other, then a and b."""

    task: Program
    tasks: int
    has_worst: bool  # whether there is a z
    nlp: ca.Function  # (x, p) -> (f, g)
    grad_f: ca.Function  # (x, p) -> (f, gradient)
    jac_g: ca.Function  # (x, p) -> (g, Jacobian)
    hess_lag: ca.Function  # (x, p, lam_f, lam_g) -> upper triangle of the Hessian

    @property
    def variables(self) -> int:
        """Number of variables."""
        return self.task.design_size + self.tasks * _motion_size(self.task) + int(self.has_worst)

    @property
    def constraints(self) -> int:
        """Number of constraints."""
        return _first_worst_row(self.task, self.tasks) + len(self.worst_rows)

    @property
    def worst_rows(self) -> np.ndarray:
        """Where in g each task's objective is held below z; empty without z."""
        return _first_worst_row(self.task, self.tasks) + np.arange(self.tasks if self.has_worst else 0)

    def variables_of(self, k: int) -> np.ndarray:
        """Where the program of task k finds its variables in x, shape (task.variables,)."""
        return _variables_of(self.task, k)

    def constraints_of(self, k: int) -> np.ndarray:
        """Where the program of task k finds its constraints in g, shape (task.constraints,)."""
        return _constraints_of(self.task, k, self.tasks)

    def join(self, parts: Sequence[np.ndarray], worst: float) -> np.ndarray:
        """Variables of the tasks' programs and z -> x; the design is the first one's."""
        d = self.task.design_size
        return np.concatenate([parts[0][:d], *(part[d:] for part in parts), [worst] * self.has_worst])

    def instance(self, parts: Sequence[Instance], weights: Sequence[float], worst_weight: float) -> Instance:
        """Parameters and bounds of all tasks together, with a = `weights` and b = `worst_weight`."""
        motions, below = _motion_constraints(self.task), np.zeros(len(self.worst_rows))
        return Instance(
            parameters=np.concatenate([*(part.parameters for part in parts), weights, [worst_weight]]),
            lower_x=self.join([part.lower_x for part in parts], -np.inf),
            upper_x=self.join([part.upper_x for part in parts], np.inf),
            lower_g=np.concatenate(
                [*(part.lower_g[:motions] for part in parts), parts[0].lower_g[motions:], below - np.inf]
            ),
            upper_g=np.concatenate([*(part.upper_g[:motions] for part in parts), parts[0].upper_g[motions:], below]),
        )


def build_shared_program(task: Program, tasks: int, *, has_worst: bool = False, threads: int = 1) -> SharedProgram:
    """Put a task's program side by side with itself, `tasks` times.

    Parameters
    ----------
    has_worst
        Whether the worst task's objective is a variable of its own.
    threads
        How many evaluate the tasks' functions.
    """
    places = [_variables_of(task, k) for k in range(tasks)]
    rows = [_constraints_of(task, k, tasks) for k in range(tasks)]
    motions, size = _motion_constraints(task), task.design_size + tasks * _motion_size(task)
    x = ca.MX.sym("x", size + int(has_worst))
    p = ca.MX.sym("p", (task.nlp.numel_in(1) + 1) * tasks + 1)
    columns = ca.reshape(x[np.concatenate(places).tolist()], task.variables, tasks)
    parameters = ca.reshape(p[: -tasks - 1], -1, tasks)
    weights, worst_weight = p[-tasks - 1 : -1], p[-1]

    def over_tasks(function: ca.Function, *more: Any) -> Any:
        mapped = function.map(tasks, "thread", threads) if threads > 1 else function.map(tasks)
        return mapped(columns, parameters, *more)

    values, g_tasks = over_tasks(task.nlp)
    f = values @ weights
    g = ca.vertcat(ca.vec(g_tasks[:motions, :]), g_tasks[motions:, 0])
    _, gradients = over_tasks(task.grad_f)
    slopes = ca.densify(gradients)
    gradient = _gather_gradient(places, slopes * ca.repmat(weights.T, task.variables, 1), size)
    _, jacobians = over_tasks(task.jac_g)
    jac = _gather_jacobian(task, places, rows, jacobians, (g.numel(), size))

    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.numel() + tasks * int(has_worst))
    shares = lam_f * weights
    if has_worst:
        f, gradient = f + worst_weight * x[-1], ca.vertcat(gradient, worst_weight)
        g, jac = ca.vertcat(g, values.T - x[-1]), _with_worst_rows(places, jac, slopes)
        shares = shares + lam_g[-tasks:]
    multipliers = ca.reshape(lam_g[np.concatenate(rows).tolist()], task.constraints, tasks) * _once(task, tasks)
    hess = _gather_hessian(task, places, over_tasks(task.hess_lag, shares.T, multipliers), x.numel())
    return SharedProgram(
        task=task,
        tasks=tasks,
        has_worst=has_worst,
        nlp=ca.Function("nlp", [x, p], [f, g], ["x", "p"], ["f", "g"]),
        grad_f=ca.Function("nlp_grad_f", [x, p], [f, gradient], ["x", "p"], ["f", "grad_f_x"]),
        jac_g=ca.Function("nlp_jac_g", [x, p], [g, jac], ["x", "p"], ["g", "jac_g_x"]),
        hess_lag=ca.Function(
            "nlp_hess_l", [x, p, lam_f, lam_g], [hess], ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]
        ),
    )


def _motion_size(task: Program) -> int:
    return task.variables - task.design_size


def _motion_constraints(task: Program) -> int:
    return task.intervals * task.interval_constraints


def _variables_of(task: Program, k: int) -> np.ndarray:
    d, size = task.design_size, _motion_size(task)
    return np.concatenate([np.arange(d), d + k * size + np.arange(size)])


def _constraints_of(task: Program, k: int, tasks: int) -> np.ndarray:
    motions = _motion_constraints(task)
    return np.concatenate([k * motions + np.arange(motions), tasks * motions + np.arange(task.constraints - motions)])


def _first_worst_row(task: Program, tasks: int) -> int:
    return tasks * _motion_constraints(task) + task.motor_constraints


def _once(task: Program, tasks: int) -> ca.DM:
    """Every task's program holds the design constraints; with this mask the first one's alone count."""
    mask = np.ones((task.constraints, tasks))
    mask[_motion_constraints(task) :, 1:] = 0
    return ca.DM(mask)


def _gather_gradient(places: list[np.ndarray], gradients: Any, size: int) -> Any:
    where = np.concatenate(places)
    return ca.densify(scatter(ca.vec(gradients), where, np.zeros_like(where), (size, 1)))


def _with_worst_rows(places: list[np.ndarray], jac: Any, gradients: Any) -> Any:
    """Below the Jacobian, the gradients of f_k - z."""
    tasks, size = len(places), jac.shape[1]
    rows = np.repeat(np.arange(tasks), len(places[0]))
    own = scatter(ca.vec(gradients), rows, np.concatenate(places), (tasks, size))
    return ca.vertcat(ca.horzcat(jac, ca.MX(jac.shape[0], 1)), ca.horzcat(own, ca.MX(-ca.DM.ones(tasks, 1))))


def _gather_jacobian(
    task: Program, places: list[np.ndarray], rows: list[np.ndarray], jacobians: Any, shape: tuple[int, int]
) -> Any:
    """Rows of the design constraints come from the first task alone."""
    a, b = (np.array(part) for part in task.jac_g.sparsity_out(1).get_triplet())
    own = a < _motion_constraints(task)
    all_rows = [np.where(own | (k == 0), row[a], -1) for k, row in enumerate(rows)]
    all_columns = [place[b] for place in places]
    return scatter(jacobians.nz[:], np.concatenate(all_rows), np.concatenate(all_columns), shape)


def _gather_hessian(task: Program, places: list[np.ndarray], hessians: Any, size: int) -> Any:
    a, b = (np.array(part) for part in task.hess_lag.sparsity_out(0).get_triplet())
    first, second = (np.concatenate([place[part] for place in places]) for part in (a, b))
    return scatter(hessians.nz[:], np.minimum(first, second), np.maximum(first, second), (size, size))
