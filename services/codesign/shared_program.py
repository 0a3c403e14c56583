"""The program of all tasks with one design: Problem 1 itself, which the paper holds for intractable.

It is the tasks' own programs side by side: variables ``x = [design (7n), motion_0, motion_1, ...]`` where a motion is
``[t_f, interval_0, ..., interval_(N-1)]``; constraints ``g = [intervals of task 0, of task 1, ..., design
constraints]``; the objective is the sum of the tasks' own (their weights are among their parameters). So the
derivatives are those of a task's program gathered into place, and nothing is unrolled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from services.codesign.instance import Instance
from services.codesign.motor_data import CONSTRAINTS
from services.codesign.program import Program, scatter


@dataclass(frozen=True)
class SharedProgram:
    """Functions and index sets; `p` lists the parameters of the tasks, one after the other."""

    task: Program
    tasks: int
    nlp: ca.Function  # (x, p) -> (f, g)
    grad_f: ca.Function  # (x, p) -> (f, gradient)
    jac_g: ca.Function  # (x, p) -> (g, Jacobian)
    hess_lag: ca.Function  # (x, p, lam_f, lam_g) -> upper triangle of the Hessian

    @property
    def variables(self) -> int:
        """Number of variables."""
        return self.task.design_size + self.tasks * _motion_size(self.task)

    @property
    def constraints(self) -> int:
        """Number of constraints."""
        return self.tasks * _motion_constraints(self.task) + len(CONSTRAINTS) * self.task.layout.joints

    def variables_of(self, k: int) -> np.ndarray:
        """Where the program of task k finds its variables in x, shape (task.variables,)."""
        return _variables_of(self.task, k)

    def constraints_of(self, k: int) -> np.ndarray:
        """Where the program of task k finds its constraints in g, shape (task.constraints,)."""
        return _constraints_of(self.task, k, self.tasks)

    def join(self, parts: Sequence[np.ndarray]) -> np.ndarray:
        """Variables of the tasks' programs -> x; the design is the first one's."""
        d = self.task.design_size
        return np.concatenate([parts[0][:d], *(part[d:] for part in parts)])

    def instance(self, parts: Sequence[Instance]) -> Instance:
        """Parameters and bounds of all tasks together."""
        motions = _motion_constraints(self.task)
        return Instance(
            parameters=np.concatenate([part.parameters for part in parts]),
            lower_x=self.join([part.lower_x for part in parts]),
            upper_x=self.join([part.upper_x for part in parts]),
            lower_g=np.concatenate([*(part.lower_g[:motions] for part in parts), parts[0].lower_g[motions:]]),
            upper_g=np.concatenate([*(part.upper_g[:motions] for part in parts), parts[0].upper_g[motions:]]),
        )


def build_shared_program(task: Program, tasks: int) -> SharedProgram:
    """Put a task's program side by side with itself, `tasks` times."""
    places = [_variables_of(task, k) for k in range(tasks)]
    rows = [_constraints_of(task, k, tasks) for k in range(tasks)]
    motions = _motion_constraints(task)
    x = ca.MX.sym("x", task.design_size + tasks * _motion_size(task))
    p = ca.MX.sym("p", task.nlp.numel_in(1) * tasks)
    columns = ca.reshape(x[np.concatenate(places).tolist()], task.variables, tasks)
    parameters = ca.reshape(p, -1, tasks)

    values, g_tasks = task.nlp.map(tasks)(columns, parameters)
    f, g = ca.sum2(values), ca.vertcat(ca.vec(g_tasks[:motions, :]), g_tasks[motions:, 0])

    _, gradients = task.grad_f.map(tasks)(columns, parameters)
    where = np.concatenate(places)
    gradient = ca.densify(scatter(ca.vec(ca.densify(gradients)), where, np.zeros_like(where), (x.numel(), 1)))

    _, jacobians = task.jac_g.map(tasks)(columns, parameters)
    jac = _gather_jacobian(task, places, rows, jacobians, (g.numel(), x.numel()))

    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.numel())
    multipliers = ca.reshape(lam_g[np.concatenate(rows).tolist()], task.constraints, tasks) * _once(task, tasks)
    hessians = task.hess_lag.map("hessians", "serial", tasks, [2], [])(columns, parameters, lam_f, multipliers)
    hess = _gather_hessian(task, places, hessians, x.numel())
    return SharedProgram(
        task=task,
        tasks=tasks,
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


def _once(task: Program, tasks: int) -> ca.DM:
    """Every task's program holds the design constraints; with this mask the first one's alone count."""
    mask = np.ones((task.constraints, tasks))
    mask[_motion_constraints(task) :, 1:] = 0
    return ca.DM(mask)


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
