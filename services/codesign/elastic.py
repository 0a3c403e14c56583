"""A task's limits made elastic: by how much they would have to give at least for a motion to exist.

min sum_k e_k  over motions, designs and shares e_k >= 0, where limit k of size s_k gives by e_k s_k: the L1 penalty of
an infeasible program alone, without the objective (Nocedal & Wright, Numerical Optimization, 2nd ed., section 17.2).
The sum of shares gathers what is missing in few limits, so it names them. Dynamics, the task's ends and the bounds of
the design do not give; joint ranges, speeds, currents, voltages, the time allowed and the motors' constraints do. A
limit of one joint or motor gives everywhere alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from services.codesign.elimination import Elimination, border_stage, in_order, interval_stage, number_unknowns
from services.codesign.guess import Guess
from services.codesign.instance import Instance, scales_of
from services.codesign.interval import IntervalLayout
from services.codesign.kept import Kept
from services.codesign.motor import constraint_limits
from services.codesign.motor_data import CONSTRAINTS
from services.codesign.problem import Problem
from services.codesign.program import Program

PATH_LIMITS = ("range", "speed", "current", "voltage")
"""Of each joint, in the order of the shares: all ranges, all speeds, ...; then the time, the motors' constraints."""

KEPT = 1e-4
"""Share of a limit up to which it counts as kept."""

MOST = 100.0
"""Upper bound of a share: beyond it the task is hopeless, and the solver wanders."""


@dataclass(frozen=True)
class ElasticProgram:
    """Functions of (x, e): the program's constraints, then those that limits make, from above and from below.

    The parameter vector is the program's with the limits' sizes behind it.
    """

    base: Program
    rows_x: np.ndarray  # variables with a limit
    rows_g: np.ndarray  # constraints that are limits
    group: np.ndarray  # which share each of them has, variables first
    variables: int
    constraints: int
    nlp: ca.Function
    grad_f: ca.Function
    jac_g: ca.Function
    hess_lag: ca.Function


@dataclass(frozen=True)
class Unmet:
    """A limit that cannot be met while the others are met or give as well."""

    share: float  # by which it would have to give
    words: str  # which limit, with what it would have to be and what it is


MOST_PROGRAMS = 4
"""Kept in a process."""

_PROGRAMS: Kept[tuple[Program, ElasticProgram]] = Kept(MOST_PROGRAMS)


def load_elastic(program: Program) -> ElasticProgram:
    """The elastic form of a program, kept in the process, and the program with it: so its id stays its own."""
    _, elastic = _PROGRAMS.get(id(program), lambda: (program, _build(program)))
    return elastic


def _build(program: Program) -> ElasticProgram:
    m, shares = program.constraints, _shares(program.layout)
    rows_x, group_x = _limited_variables(program)
    rows_g, group_g = _limited_constraints(program)
    group = np.concatenate([group_x, group_g])
    x, e = ca.MX.sym("x", program.variables), ca.MX.sym("e", shares)
    p, size = ca.MX.sym("p", program.nlp.size1_in(1)), ca.MX.sym("size", shares)
    z, q = ca.vertcat(x, e), ca.vertcat(p, size)
    belongs = ca.DM.triplet(list(range(len(group))), group.tolist(), ca.DM.ones(len(group)), len(group), shares)
    _, g = program.nlp(x, p)
    limited, gives = ca.vertcat(x[rows_x.tolist()], g[rows_g.tolist()]), belongs @ (e * size)
    _, jac = program.jac_g(x, p)
    pick = ca.DM.eye(program.variables)[rows_x.tolist(), :]
    slope, by_share = ca.vertcat(pick, jac[rows_g.tolist(), :]), belongs @ ca.diag(size)
    whole = ca.vertcat(ca.horzcat(jac, ca.MX(m, shares)), ca.horzcat(slope, -by_share), ca.horzcat(slope, by_share))
    lam_f, lam = ca.MX.sym("lam_f"), ca.MX.sym("lam", m + 2 * len(group))
    hard, above, below = ca.vertsplit(lam, [0, m, m + len(group), m + 2 * len(group)])
    into = ca.DM.triplet(rows_g.tolist(), list(range(len(rows_g))), ca.DM.ones(len(rows_g)), m, len(rows_g))
    lam_g = hard + into @ (above + below)[len(rows_x) :]
    hessian = ca.diagcat(program.hess_lag(x, p, 0, lam_g), ca.MX(shares, shares))
    f, gradient = ca.sum1(e), ca.DM([0.0] * program.variables + [1.0] * shares)
    constraints = ca.vertcat(g, limited - gives, limited + gives)
    return ElasticProgram(
        base=program,
        rows_x=rows_x,
        rows_g=rows_g,
        group=group,
        variables=program.variables + shares,
        constraints=m + 2 * len(group),
        nlp=ca.Function("nlp", [z, q], [f, constraints], ["x", "p"], ["f", "g"]),
        grad_f=ca.Function("nlp_grad_f", [z, q], [f, gradient], ["x", "p"], ["f", "grad_f_x"]),
        jac_g=ca.Function("nlp_jac_g", [z, q], [constraints, whole], ["x", "p"], ["g", "jac_g_x"]),
        hess_lag=ca.Function(
            "nlp_hess_l", [z, q, lam_f, lam], [hessian], ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]
        ),
    )


def _shares(layout: IntervalLayout) -> int:
    return (len(PATH_LIMITS) + len(CONSTRAINTS)) * layout.joints + 1


def _limited_variables(program: Program) -> tuple[np.ndarray, np.ndarray]:
    """All variables but the design, with the limit of each: t_f, then the intervals'."""
    layout, joints = program.layout, np.arange(program.layout.joints)
    kinds = (0, 1, 2, 2) if layout.control == "voltage" else (0, 1)
    tail = 3 if layout.control == "voltage" else 2
    interval = np.concatenate([kind * len(joints) + joints for kind in [*kinds * layout.stops, tail, tail]])
    rows = np.arange(program.time_index, program.variables)
    time = len(PATH_LIMITS) * len(joints)
    return rows, np.concatenate([[time], np.tile(interval, program.intervals)])


def _limited_constraints(program: Program) -> tuple[np.ndarray, np.ndarray]:
    """Constraints that are limits, with the limit of each: voltages and speeds between points, and the motors'."""
    layout, n = program.layout, program.layout.joints
    joints, inside = np.arange(n), np.arange(layout.equalities, program.interval_constraints)
    voltages = 2 * len(layout.voltage_checks) if layout.inequalities else 0
    kinds = [3] * voltages + [1] * (layout.inequalities // n - voltages)
    one = np.concatenate([kind * n + joints for kind in kinds]) if kinds else np.empty(0, dtype=int)
    starts = np.arange(program.intervals)[:, None] * program.interval_constraints
    motors = np.arange(program.motor_constraints)
    rows = np.concatenate([(starts + inside).ravel(), program.intervals * program.interval_constraints + motors])
    return rows, np.concatenate([np.tile(one, program.intervals), len(PATH_LIMITS) * n + 1 + motors])


def elastic_instance(problem: Problem, elastic: ElasticProgram, instance: Instance) -> Instance:
    """The numbers of a problem for the elastic program; what is pinned but for the time stays pinned."""
    lower_x, upper_x = instance.lower_x.copy(), instance.upper_x.copy()
    lower_g, upper_g = instance.lower_g.copy(), instance.upper_g.copy()
    low = np.concatenate([lower_x[elastic.rows_x], lower_g[elastic.rows_g]])
    high = np.concatenate([upper_x[elastic.rows_x], upper_g[elastic.rows_g]])
    time = elastic.rows_x[0]
    pinned = low == high
    pinned[0] = False
    low[0] = -np.inf  # the earliest end is no limit that gives
    low[pinned], high[pinned] = -np.inf, np.inf
    free = elastic.rows_x[1:][~pinned[1 : len(elastic.rows_x)]]
    lower_x[free], upper_x[free], upper_x[time] = -np.inf, np.inf, np.inf
    lower_g[elastic.rows_g], upper_g[elastic.rows_g] = -np.inf, np.inf
    sizes = limit_sizes(problem)
    limited = np.isin(np.arange(len(sizes)), elastic.group[np.isfinite(low) | np.isfinite(high)])
    open_ended = np.full(len(low), np.inf)
    return Instance(
        parameters=np.concatenate([instance.parameters, sizes]),
        lower_x=np.concatenate([lower_x, np.zeros(len(sizes))]),
        upper_x=np.concatenate([upper_x, np.where(limited, MOST, 0.0)]),
        lower_g=np.concatenate([lower_g, -open_ended, low]),
        upper_g=np.concatenate([upper_g, high, open_ended]),
    )


def limit_sizes(problem: Problem) -> np.ndarray:
    """What a share of 1 is, in the program's units, by limit: half a range, the limit itself."""
    robot, n = problem.robot, problem.robot.joints
    low, high = constraint_limits(problem.motor)
    limits = np.where(np.isfinite(low), low, high)
    path = [(robot.joint_upper - robot.joint_lower) / 2, np.ones(3 * n)]
    return np.concatenate([*path, [problem.final_time_bounds[1]], np.tile(np.abs(limits), n)])


def elastic_elimination(elastic: ElasticProgram, instance: Instance) -> Elimination:
    """The program's own order; each limit's slack and multiplier go with what is limited, the shares come last."""
    base, intervals = elastic.base, elastic.base.intervals
    variable, slack, multiplier = number_unknowns(
        instance.lower_x != instance.upper_x, instance.lower_g == instance.upper_g
    )
    stage = np.concatenate(
        [
            (elastic.rows_x - base.time_index - 1) // base.layout.variables,
            np.minimum(elastic.rows_g // base.interval_constraints, intervals),
        ]
    )
    stage[0] = intervals  # t_f
    pairs = np.column_stack([slack, multiplier])[base.constraints :]
    stages = [interval_stage(base, w, variable, slack, multiplier) for w in range(intervals)]
    stages.append(border_stage(base, variable, slack, multiplier))
    shares = variable[base.variables :]
    stages[-1] = (stages[-1][0], np.append(stages[-1][1], shares[shares >= 0]))
    where = np.tile(stage, 2)
    return in_order(
        [(np.concatenate([pairs[where == w], own]), rest) for w, (own, rest) in enumerate(stages)], len(multiplier)
    )


def elastic_start(elastic: ElasticProgram, x: np.ndarray) -> Guess:
    """A point of the program with every limit given a little."""
    return Guess(np.concatenate([x, np.full(elastic.variables - len(x), 0.1)]))


def unmet_limits(problem: Problem, shares: np.ndarray) -> tuple[Unmet, ...]:
    """Limits whose shares are above `KEPT`, the largest first, in words."""
    return tuple(
        Unmet(float(shares[k]), _words(problem, int(k), shares[k])) for k in np.argsort(-shares) if shares[k] > KEPT
    )


def _words(problem: Problem, limit: int, share: float) -> str:
    n, scales = problem.robot.joints, scales_of(problem)
    kind, k = divmod(limit, n)
    factor = 1 + share
    if kind == 0:
        return f"joint {k + 1} leaves its range by {share * limit_sizes(problem)[limit]:.3g} rad"
    if kind == 1:
        speed = scales.speed[k]
        return f"joint {k + 1} turns at {factor * speed:.4g} rad/s, {speed:.4g} rad/s are allowed"
    if kind == 2:
        return f"motor {k + 1} takes {factor * scales.current:.4g} A, {scales.current:.4g} A are allowed"
    if kind == 3:
        return f"motor {k + 1} takes {factor * scales.voltage:.4g} V, {scales.voltage:.4g} V are allowed"
    if limit == len(PATH_LIMITS) * n:
        latest = problem.final_time_bounds[1]
        return f"the motion takes {factor * latest:.4g} s, {latest:.4g} s are allowed"
    motor, c = divmod(limit - len(PATH_LIMITS) * n - 1, len(CONSTRAINTS))
    low, high = (bound[c] for bound in constraint_limits(problem.motor))
    value, bound = (low - share * abs(low), low) if np.isfinite(low) else (high + share * abs(high), high)
    return f"motor {motor + 1} has {CONSTRAINTS[c]} = {value:.4g}, the limit is {bound:.4g}"
