"""The nonlinear program of one task: interval kernels laid side by side, bordered by the design and t_f.

Variables ``x = [design, t_f, interval_0, ..., interval_(N-1)]``, all scaled but t_f [s], where the design is seven
lengths for each motor and the gear ratios that are free, over the robot's; constraints ``g = [interval constraints
0..N-1, design constraints motor by motor]``. A joint has a motor of its own, or shares one.

The sparsity is known from the kernels', so the derivatives are gathered into place rather than found by differentiating
the whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from services.codesign.interval import IntervalLayout, parameter_sizes
from services.codesign.kept import Kept
from services.codesign.kernels import SHARED_INPUTS, Kernels, load_kernels
from services.codesign.motor_data import CONSTRAINTS, DIMENSIONS
from services.codesign.problem import Problem
from services.codesign.robot import Robot


@dataclass(frozen=True)
class Program:
    """Functions and index sets; the numbers of a task come with the parameter vector and the bounds.

    The parameter vector is ``[kernel parameters, start state (4n), widths (N), time weight, effort weight]``, and the
    objective ``time weight * t_f + effort weight * integral of u'u``.
    """

    layout: IntervalLayout
    intervals: int
    motor_of: tuple[int, ...]  # the motor, 0..m-1, of each joint
    kernels: Kernels
    nlp: ca.Function  # (x, p) -> (f, g)
    grad_f: ca.Function  # (x, p) -> (f, gradient)
    jac_g: ca.Function  # (x, p) -> (g, Jacobian)
    hess_lag: ca.Function  # (x, p, lam_f, lam_g) -> upper triangle of the Hessian

    @property
    def lengths(self) -> int:
        """Number of lengths in a design: 7m."""
        return len(DIMENSIONS) * (max(self.motor_of) + 1)

    @property
    def design_size(self) -> int:
        """Number of variables of a design: lengths, then free gear ratios."""
        return self.lengths + len(self.layout.free_gears)

    @property
    def motor_constraints(self) -> int:
        """Constraints on the motors: 6m."""
        return len(CONSTRAINTS) * (max(self.motor_of) + 1)

    @property
    def time_index(self) -> int:
        """Index of t_f in x."""
        return self.design_size

    @property
    def variables(self) -> int:
        """Number of variables."""
        return self.design_size + 1 + self.intervals * self.layout.variables

    @property
    def interval_constraints(self) -> int:
        """Constraints of one interval."""
        return self.layout.equalities + self.layout.inequalities

    @property
    def constraints(self) -> int:
        """Number of constraints."""
        return self.intervals * self.interval_constraints + self.motor_constraints

    def split(self, x: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
        """x -> scaled design (n, 7), t_f [s], interval variables (N, layout.variables)."""
        design = x[: self.lengths].reshape(-1, len(DIMENSIONS))[list(self.motor_of)]
        intervals = x[self.design_size + 1 :].reshape(self.intervals, self.layout.variables)
        return design, float(x[self.time_index]), intervals

    def join(
        self, design: np.ndarray, final_time: float, intervals: np.ndarray, gears: np.ndarray | None = None
    ) -> np.ndarray:
        """Inverse of `split`, with free gear ratios over the robot's: 1 when None; of joints alike the first counts."""
        first = [self.motor_of.index(motor) for motor in range(max(self.motor_of) + 1)]
        shares = np.ones(len(self.layout.free_gears)) if gears is None else gears
        return np.concatenate([design[first].ravel(), shares, [final_time], intervals.ravel()])

    def gear_shares(self, x: np.ndarray) -> np.ndarray:
        """Gear ratios over the robot's, shape (n,): 1 where they are not free."""
        shares = np.ones(self.layout.joints)
        shares[list(self.layout.free_gears)] = x[self.lengths : self.design_size]
        return shares


MOST_PROGRAMS = 12
"""Kept in a process."""

_PROGRAMS: Kept[Program] = Kept(MOST_PROGRAMS)


def load_program(
    robot: Robot,
    layout: IntervalLayout,
    intervals: int,
    cache: Path | None = None,
    motor_of: tuple[int, ...] | None = None,
) -> Program:
    """The program of an arm on a grid, kept in the process; without `motor_of` every joint has its own motor."""
    kernels, motors = load_kernels(robot, layout, cache), motor_of or tuple(range(layout.joints))
    key = (id(kernels), intervals, motors)  # a program that is kept keeps its kernels, and so their id
    return _PROGRAMS.get(key, lambda: build_program(kernels, layout, intervals, motors))


def program_of(problem: Problem) -> Program:
    """The program that a problem is an instance of."""
    return load_program(problem.robot, problem.layout, problem.transcription.intervals, motor_of=problem.motor_of)


def build_program(
    kernels: Kernels, layout: IntervalLayout, intervals: int, motor_of: tuple[int, ...] | None = None
) -> Program:
    """Assemble the program's functions from an interval's; without `motor_of` every joint has its own motor."""
    motor_of = motor_of or tuple(range(layout.joints))
    s = _Symbols(layout, intervals, motor_of)
    N, motors = intervals, max(motor_of) + 1
    calls = -(-N // kernels.lanes)
    idle = calls * kernels.lanes - N  # lanes of the last call that evaluate the last interval again
    indices = _Indices(layout, intervals, idle, motor_of)
    starts, columns, widths = (_widened(part, idle) for part in (s.starts, s.columns, s.widths))

    def over_intervals(function: ca.Function, *more: Any) -> Any:
        """Output with a column for each interval, idle lanes included."""
        mapped = function.map(function.name(), "serial", calls, list(SHARED_INPUTS), [])
        others = (_widened(part, idle) for part in more)
        return mapped(starts, columns, s.design, s.final_time, widths, s.parameters, *others)

    def over_motors(function: ca.Function, *more: Any) -> Any:
        mapped = function.map(function.name(), "serial", motors, [1], [])
        return mapped(ca.reshape(s.x[: len(DIMENSIONS) * motors], len(DIMENSIONS), motors), s.parameters, *more)

    def weighted(name: str, effort: Any) -> Any:
        """A function of the effort times its weight, not evaluated where that is zero."""
        symbols, nothing = [s.x, s.p], ca.DM.zeros(*effort.shape)
        of_effort, none = ca.Function(name, symbols, [effort]), ca.Function(f"no_{name}", symbols, [nothing])
        return s.effort_weight * ca.Function.if_else(f"{name}_or_none", of_effort, none)(s.effort_weight != 0, *symbols)

    g_intervals, efforts = over_intervals(kernels.value)
    f = s.time_weight * s.final_time + weighted("effort", ca.sum2(efforts[:, :N]))
    g = ca.vertcat(ca.vec(g_intervals[:, :N]), ca.vec(over_motors(kernels.motor_value)))

    jac = indices.jacobian(kernels, over_intervals(kernels.jacobian), over_motors(kernels.motor_jacobian))
    slopes = indices.gradient(kernels, over_intervals(kernels.effort_gradient))
    gradient = weighted("effort_gradient", slopes) + _unit(s.time_weight, indices)

    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.shape[0])
    split = N * (layout.equalities + layout.inequalities)
    lam_intervals = ca.reshape(lam_g[:split], -1, N)
    hessian = over_intervals(kernels.hessian, lam_intervals, ca.repmat(lam_f * s.effort_weight, 1, N))
    motor_hessian = over_motors(kernels.motor_hessian, ca.reshape(lam_g[split:], len(CONSTRAINTS), motors))
    hess = indices.hessian(kernels, hessian, motor_hessian)

    return Program(
        layout=layout,
        intervals=intervals,
        motor_of=motor_of,
        kernels=kernels,
        nlp=ca.Function("nlp", [s.x, s.p], [f, g], ["x", "p"], ["f", "g"]),
        grad_f=ca.Function("nlp_grad_f", [s.x, s.p], [f, gradient], ["x", "p"], ["f", "grad_f_x"]),
        jac_g=ca.Function("nlp_jac_g", [s.x, s.p], [g, jac], ["x", "p"], ["g", "jac_g_x"]),
        hess_lag=ca.Function(
            "nlp_hess_l", [s.x, s.p, lam_f, lam_g], [hess], ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]
        ),
    )


def _widened(matrix: Any, more: int) -> Any:
    """The last column `more` times again."""
    return ca.horzcat(matrix, ca.repmat(matrix[:, -1], 1, more)) if more else matrix


def _unit(value: Any, indices: _Indices) -> Any:
    unit = ca.DM.zeros(indices.size)
    unit[indices.time] = 1
    return unit * value


def _design_places(layout: IntervalLayout, motor_of: tuple[int, ...]) -> np.ndarray:
    """Where in x each number of a design as the kernels have it is, shape (layout.design_size,)."""
    lengths = len(DIMENSIONS) * np.array(motor_of)[:, None] + np.arange(len(DIMENSIONS))
    gears = len(DIMENSIONS) * (max(motor_of) + 1) + np.arange(len(layout.free_gears))
    return np.concatenate([lengths.ravel(), gears])


class _Symbols:
    """Symbolic x and p, and their parts as the kernels take them."""

    def __init__(self, layout: IntervalLayout, intervals: int, motor_of: tuple[int, ...]) -> None:
        n, N = layout.joints, intervals
        places = _design_places(layout, motor_of)
        sizes = [int(places.max()) + 1, 1, N * layout.variables]
        self.x = ca.MX.sym("x", sum(sizes))
        design, self.final_time, flat = ca.vertsplit(self.x, np.cumsum([0, *sizes]).tolist())
        self.design = design[places.tolist()]
        self.columns = ca.reshape(flat, layout.variables, N)
        parts = [sum(parameter_sizes(n).values()), layout.state_size, N, 1, 1]
        self.p = ca.MX.sym("p", sum(parts))
        self.parameters, start, widths, self.time_weight, self.effort_weight = ca.vertsplit(
            self.p, np.cumsum([0, *parts]).tolist()
        )
        self.widths = widths.T
        self.starts = ca.horzcat(start, self.columns[layout.end_state, : N - 1])


class _Indices:
    """Where each kernel derivative goes in the whole program."""

    def __init__(self, layout: IntervalLayout, intervals: int, idle: int, motor_of: tuple[int, ...]) -> None:
        self.layout, self.intervals, self.evaluated = layout, intervals, intervals + idle
        self.motors, self.design = max(motor_of) + 1, _design_places(layout, motor_of)
        self.time = int(self.design.max()) + 1
        self.size = self.time + 1 + intervals * layout.variables
        self.rows = layout.equalities + layout.inequalities

    def columns(self, w: int) -> np.ndarray:
        """Program index of each entry of a kernel's v in interval w; -1 for the start state and idle lanes."""
        if w >= self.intervals:
            return np.full(self.layout.state_size + self.layout.variables + len(self.design) + 1, -1)
        layout, first = self.layout, self.time + 1 + w * self.layout.variables
        start = first - layout.variables + np.array(layout.end_state)
        own = first + np.arange(layout.variables)
        return np.concatenate([start if w else np.full(layout.state_size, -1), own, self.design, [self.time]])

    def jacobian(self, kernels: Kernels, interval: Any, motor: Any) -> Any:
        local = _places(kernels, "jacobian")
        local_motor = _places(kernels, "motor_jacobian")
        constraints = len(CONSTRAINTS)
        first = self.intervals * self.rows
        rows = [w * self.rows + local[0] for w in range(self.evaluated)]
        cols = [self.columns(w)[local[1]] for w in range(self.evaluated)]
        rows += [first + constraints * k + local_motor[0] for k in range(self.motors)]
        cols += [len(DIMENSIONS) * k + local_motor[1] for k in range(self.motors)]
        values = ca.vertcat(_nonzeros(interval), _nonzeros(motor))
        return scatter(
            values, np.concatenate(rows), np.concatenate(cols), (first + constraints * self.motors, self.size)
        )

    def gradient(self, kernels: Kernels, efforts: Any) -> Any:
        local, _ = _places(kernels, "effort_gradient")
        cols = np.concatenate([self.columns(w)[local] for w in range(self.evaluated)])
        return ca.densify(scatter(_nonzeros(efforts), cols, np.zeros_like(cols), (self.size, 1)))

    def hessian(self, kernels: Kernels, interval: Any, motor: Any) -> Any:
        local = _places(kernels, "hessian")
        local_motor = _places(kernels, "motor_hessian")
        pairs = [self.columns(w)[part] for w in range(self.evaluated) for part in local]
        pairs += [len(DIMENSIONS) * k + part for k in range(self.motors) for part in local_motor]
        a, b = np.concatenate(pairs[0::2]), np.concatenate(pairs[1::2])
        values = ca.vertcat(_nonzeros(interval), _nonzeros(motor))
        across = np.concatenate([part[0] != part[1] for part in [local] * self.evaluated + [local_motor] * self.motors])
        # Two lengths that are one variable: both halves of the matrix meet on the diagonal.
        twice = (a == b) & (a >= 0) & across
        if twice.any():
            values = values * ca.DM(1.0 + twice)
        return scatter(values, np.minimum(a, b), np.maximum(a, b), (self.size, self.size))


def _places(kernels: Kernels, name: str) -> list[np.ndarray]:
    """Row and column of each nonzero of one interval's, or one motor's, output."""
    return [np.array(part, dtype=int) for part in kernels.pattern(name).get_triplet()]


def _nonzeros(matrix: Any) -> Any:
    return ca.sparsity_cast(matrix, ca.Sparsity.dense(matrix.nnz(), 1))


def scatter(values: Any, rows: np.ndarray, cols: np.ndarray, shape: tuple[int, int]) -> Any:
    """Sparse matrix with `values` added up at (rows, cols); entries with a negative index are dropped."""
    keep = (rows >= 0) & (cols >= 0)
    places, inverse = np.unique(cols[keep] * shape[0] + rows[keep], return_inverse=True)
    counts = np.bincount(places // shape[0], minlength=shape[1])
    sparsity = ca.Sparsity(*shape, np.concatenate([[0], np.cumsum(counts)]).tolist(), (places % shape[0]).tolist())
    if len(places) == len(inverse):
        order = np.empty(len(places), dtype=int)
        order[inverse] = np.flatnonzero(keep)
        return ca.MX(sparsity, values[order.tolist()])
    where = np.full(len(rows), len(places))  # what is dropped is added up behind the end
    where[keep] = inverse
    every = ca.MX.sym("every", len(places) + 1)
    sums = ca.jtimes(every.nz[where.tolist()], every, values, True)  # adding up is the adjoint of taking
    return ca.MX(sparsity, sums[:-1])
