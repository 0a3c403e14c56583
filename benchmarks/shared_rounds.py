"""The shared optimum in rounds, beside the joint program: `python -m benchmarks.shared_rounds [--every 6]`.

A round solves every task's motion with the design proposed, which any number of workers could do at once, and takes
from each its value V_k, the gradient (the multipliers of the pinned design) and the exact second derivative (the Schur
complement of its optimality system). A master then minimises the sum of the quadratic models over the motors' feasible
set and a box around the best design (trust region), and proposes the next. Both start from the paper's two-step design.
Work is counted in solver iterations of one task, which do not depend on how busy the machine is.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from services.codesign.guess import Guess
from services.codesign.instance import Instance, build_instance, scales_of
from services.codesign.motor import constraint_limits, design_constraints
from services.codesign.problem import Problem, Task
from services.codesign.program import Program, load_program
from services.codesign.reconcile import mean_design, project_design
from services.codesign.robot import Robot
from services.codesign.shared_optimum import SharedStart, solve_shared
from services.codesign.solve import solve
from services.codesign.solver import SolverOptions, run

OPTIONS = SolverOptions(max_wall_time=600.0)
FIRST_RADIUS, SMALLEST_RADIUS, LARGEST_RADIUS = 0.1, 1e-4, 0.4
"""Of the trust region: a box in the scaled design, where every length is of order one."""
NEGLIGIBLE = 1e-7
"""A limit whose multiplier over its distance is less does not hold the motion."""
CONVERGED = 1e-5
"""Relative: a round that can gain less than this is the last."""


@dataclass(frozen=True)
class Value:
    """A task's optimum with a given design, and how it changes with that: all in scaled lengths."""

    value: float
    gradient: np.ndarray  # (7n,)
    curvature: np.ndarray  # (7n, 7n)
    point: Guess
    iterations: int


def value_of(problem: Problem, design: np.ndarray, near: Guess | None) -> Value | None:
    """V_k, its gradient and curvature at a design, (n, 7) m; None where the motion cannot be found."""
    given = replace(problem, design=design)
    program = load_program(problem.robot, problem.layout, problem.transcription.intervals)
    instance = build_instance(given, program)
    iterations = 0
    if near is not None:
        moved = near.x.copy()
        moved[: program.design_size] = instance.lower_x[: program.design_size]
        outcome = run(program, instance, replace(near, x=moved), OPTIONS)
        x, lam_x, lam_g, iterations = outcome.x, outcome.lam_x, outcome.lam_g, outcome.iterations
    if near is None or not outcome.success:
        solution = solve(given, options=OPTIONS)
        iterations += solution.iterations
        if solution.x is None or solution.lam_x is None or solution.lam_g is None or not solution.success:
            return None
        x, lam_x, lam_g = solution.x, solution.lam_x, solution.lam_g
    value = float(program.nlp(x, instance.parameters)[0])
    d = program.design_size
    return Value(value, -lam_x[:d], _curvature(program, instance, x, lam_x, lam_g), Guess(x, lam_x, lam_g), iterations)


def _curvature(program: Program, instance: Instance, x: np.ndarray, lam_x: np.ndarray, lam_g: np.ndarray) -> np.ndarray:
    """W_dd - B' K^-1 B: what eliminating the motion leaves of the optimality system on the design."""
    d, rows = program.design_size, program.intervals * program.interval_constraints
    upper = program.hess_lag(x, instance.parameters, 1.0, lam_g).sparse().tocsc()
    hessian = (upper + sparse.triu(upper, 1).T).tocsc()
    values, jacobian = program.jac_g(x, instance.parameters)
    g, jac = values.full().ravel()[:rows], jacobian.sparse().tocsc()[:rows]
    free = np.flatnonzero(instance.lower_x < instance.upper_x)
    weight = _weights(x, lam_x, instance.lower_x, instance.upper_x)[free]
    equal = instance.lower_g[:rows] == instance.upper_g[:rows]
    slack_weight = _weights(g, lam_g[:rows], instance.lower_g[:rows], instance.upper_g[:rows])
    kept = np.flatnonzero(equal | (slack_weight > NEGLIGIBLE))
    give = np.where(equal, 0.0, 1 / np.maximum(slack_weight, NEGLIGIBLE))[kept]
    a = jac[kept]
    system = sparse.bmat(
        [[hessian[free][:, free] + sparse.diags(weight), a[:, free].T], [a[:, free], -sparse.diags(give + 1e-12)]]
    )
    border = sparse.vstack([hessian[free][:, :d], a[:, :d]]).toarray()
    reduced = hessian[:d, :d].toarray() - border.T @ splu(system.tocsc()).solve(border)
    return 0.5 * (reduced + reduced.T)


def _weights(values: np.ndarray, lam: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Multiplier over distance: what a limit adds to the curvature."""
    above, below = np.maximum(upper - values, 1e-9), np.maximum(values - lower, 1e-9)
    return np.maximum(lam, 0) / above + np.maximum(-lam, 0) / below


def master(problem: Problem, at: np.ndarray, gradient: np.ndarray, curvature: np.ndarray, radius: float) -> np.ndarray:
    """Minimise the quadratic model over the motors' feasible set within the box; a scaled design (7n,)."""
    n, motor = problem.robot.joints, problem.motor
    scale = np.tile(scales_of(problem).design, n)
    x = ca.MX.sym("x", len(at))
    lengths = ca.SX.sym("lengths", 7)
    one = ca.Function("motor", [lengths], [design_constraints(lengths, motor.coefficients())])
    step = x - at
    low, high = constraint_limits(motor)
    lower = np.maximum(np.tile(motor.lower, n) / scale, at - radius)
    upper = np.minimum(np.tile(motor.upper, n) / scale, at + radius)
    g = ca.vertcat(*[one(x[7 * k : 7 * k + 7] * scale[7 * k : 7 * k + 7]) for k in range(n)])
    f = ca.dot(gradient, step) + 0.5 * ca.dot(step, ca.DM(curvature) @ step)
    solver = ca.nlpsol(
        "master",
        "ipopt",
        {"x": x, "f": f, "g": g},
        {"ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-9}, "print_time": False},
    )
    found = solver(x0=at, lbx=lower, ubx=upper, lbg=np.tile(low, n), ubg=np.tile(high, n))
    return np.array(found["x"].full().ravel())


def rounds(problems: Sequence[Problem], design: np.ndarray, most: int) -> None:
    """Trust-region rounds from a design, printed one by one."""
    scale = np.tile(scales_of(problems[0]).design, problems[0].robot.joints)
    at, radius = design.ravel() / scale, FIRST_RADIUS
    known = [value_of(problem, design, None) for problem in problems]
    assert all(known)
    best = [value for value in known if value is not None]
    total = sum(value.value for value in best)
    work = sum(value.iterations for value in best)
    print(f"round  0: {total:.5f}, {work} task iterations", flush=True)
    for number in range(1, most + 1):
        gradient = np.sum([value.gradient for value in best], axis=0)
        curvature = np.sum([value.curvature for value in best], axis=0)
        trial = master(problems[0], at, gradient, curvature, radius)
        step = trial - at
        promised = -(gradient @ step + 0.5 * step @ curvature @ step)
        if promised < CONVERGED * total or radius < SMALLEST_RADIUS:
            print(f"at an end: promised {promised:.2e}, radius {radius:.1e}")
            return
        proposed = (trial * scale).reshape(design.shape)
        found = [value_of(p, proposed, value.point) for p, value in zip(problems, best, strict=True)]
        solved = [value for value in found if value is not None]
        work += sum(value.iterations for value in solved)
        reached = sum(value.value for value in solved) if len(solved) == len(problems) else float("inf")
        share = (total - reached) / promised
        print(
            f"round {number:2d}: {reached:.5f}, promised {promised:.2e}, share {share:.2f}, radius {radius:.1e},"
            f" {work} task iterations",
            flush=True,
        )
        if share > 0.1:
            at, total, best = trial, reached, solved
        radius = min(2 * radius, LARGEST_RADIUS) if share > 0.7 else radius / 3 if share < 0.25 else radius


def main() -> None:
    """Both ways, from the two-step design."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--every", type=int, default=6, help="take every such task of the paper's 25; 1: all")
    parser.add_argument("--rounds", type=int, default=25)
    arguments = parser.parse_args()
    robot = Robot.preset("ur5")
    grid = [Task(np.full(6, stroke), np.zeros(6), float(m)) for stroke in np.linspace(0.2, 1.0, 5) for m in range(5)]
    problems = [Problem(robot, task) for task in grid[:: arguments.every]]
    own = [solve(problem, options=OPTIONS) for problem in problems]
    design = project_design(mean_design([s.design for s in own if s.design is not None]), problems[0].motor).design
    start = SharedStart(design, [s.motion for s in own if s.motion is not None])
    began = time.process_time()
    rounds(problems, design, arguments.rounds)
    print(f"rounds: {time.process_time() - began:.1f} CPU s")
    began = time.process_time()
    joint = solve_shared(problems, [1.0] * len(problems), start, OPTIONS)
    print(
        f"joint program: {joint.objective:.5f}, {joint.iterations} iterations, {joint.iterations * len(problems)} task"
        f" iterations, {time.process_time() - began:.1f} CPU s"
    )


if __name__ == "__main__":
    main()
