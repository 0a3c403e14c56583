"""Why a task cannot be done, in a sentence with numbers, units, the joint and the limit.

`impossible` holds proofs: conditions that every motion must meet, checked before any solve. `explain_failure` comes
after a failed ladder and says what is likely; a solver that is local by nature proves nothing by giving up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from services.codesign.elastic import Unmet
from services.codesign.feasible_motor import motor_obstacle
from services.codesign.guess import Guess
from services.codesign.instance import Instance, build_instance, scales_of
from services.codesign.ladder import Climb
from services.codesign.motor import constraint_limits
from services.codesign.motor_data import CONSTRAINTS
from services.codesign.problem import FINAL_TIME_BOUNDS, Objective, Problem
from services.codesign.program import Program
from services.codesign.solver import INTERRUPTED, OUT_OF_TIME, STOPPED, Progress, SolverOptions, run
from services.codesign.torque_load import torque_load

ROUNDING = 1e-9
"""Relative slack of the proofs: a task exactly at a limit is not refused."""

MOST_NAMED = 6
"""Limits that a reason names."""

ITERATIONS_EXCEEDED = "Maximum_Iterations_Exceeded"


def impossible(problem: Problem) -> str | None:
    """A proven obstacle, named with its numbers; None when no necessary condition is broken.

    The distance condition holds for the program as well as for the motion: Radau and Legendre weights are positive
    and integrate the speed exactly.
    """
    checks = (_outside_joint_range, _too_fast_at_the_ends, _too_far)
    found = next((reason for check in checks if (reason := check(problem)) is not None), None)
    return motor_obstacle(problem.motor) if found is None and problem.design is None else found


def _outside_joint_range(problem: Problem) -> str | None:
    robot = problem.robot
    for where, angles in (("starts", problem.task.start), ("ends", problem.task.end)):
        outside = (angles < robot.joint_lower - ROUNDING) | (angles > robot.joint_upper + ROUNDING)
        for k in np.flatnonzero(outside):
            low, high = robot.joint_lower[k], robot.joint_upper[k]
            return f"joint {k + 1} {where} at {angles[k]:.4g} rad; its range is {low:.4g} to {high:.4g} rad"
    return None


def _too_fast_at_the_ends(problem: Problem) -> str | None:
    limit = problem.robot.joint_speed_limit
    for where, speeds in (("starts", problem.task.start_velocity), ("ends", problem.task.end_velocity)):
        for k in np.flatnonzero(np.abs(speeds) > limit * (1 + ROUNDING)):
            return f"joint {k + 1} {where} at {speeds[k]:.4g} rad/s; {_speed_limit(problem, int(k))}"
    return None


def _too_far(problem: Problem) -> str | None:
    _, latest = problem.final_time_bounds
    distance = np.abs(problem.task.end - problem.task.start)
    needed = distance / problem.robot.joint_speed_limit
    k = int(np.argmax(needed))
    if needed[k] <= latest * (1 + ROUNDING):
        return None
    return (
        f"joint {k + 1} must turn {distance[k]:.4g} rad in {latest:.4g} s; {_speed_limit(problem, k)}, "
        f"so it needs at least {needed[k]:.3f} s"
    )


def _speed_limit(problem: Problem, k: int) -> str:
    robot = problem.robot
    if robot.joint_speed_bound[k] < robot.rotor_speed_limit / abs(robot.gear_ratio[k]):
        return f"its speed limit is {robot.joint_speed_bound[k]:.4g} rad/s"
    return (
        f"the rotor speed limit of {robot.rotor_speed_limit:.2f} rad/s through a gear of {robot.gear_ratio[k]:g} "
        f"allows {robot.joint_speed_limit[k]:.4g} rad/s"
    )


def explain_failure(
    problem: Problem,
    program: Program,
    instance: Instance,
    climb: Climb,
    *,
    options: SolverOptions,
    progress: Progress | None,
    deadline: float = math.inf,
) -> str:
    """What stands in the way of a task whose solve failed: stopped, or likely torque, time, limits, what is violated.

    When the task's latest final time is the suspect, one more solve looks for the fastest motion, until `deadline`, a
    value of `time.monotonic`.
    """
    outcome, iterations = climb.outcome, sum(attempt.iterations for attempt in climb.attempts)
    if outcome.status == STOPPED:
        return f"stopped on request after {iterations} iterations"
    if outcome.status == INTERRUPTED:
        return f"interrupted from outside after {iterations} iterations"
    if outcome.status == OUT_OF_TIME:
        return f"not solved within the {options.max_wall_time:g} s allowed for a solve"
    findings = [
        _too_heavy(problem, program, instance),
        _too_slow(problem, program, climb, options=options, progress=progress, deadline=deadline),
    ]
    found = [finding for finding in findings if finding is not None]
    found += [_least_to_give(climb.unmet)] if climb.unmet else []
    if not found:
        found = [_largest_violation(problem, program, instance, outcome.x)]
    how = "ran out of iterations" if outcome.status == ITERATIONS_EXCEEDED else "found no motion"
    return f"the solver {how} ({outcome.status}); likely, though not proven: {'; '.join(found)}"


def _least_to_give(unmet: Sequence[Unmet]) -> str:
    """The limits that would have to give, with all others kept; of many, the largest few."""
    named = [f"{limit.words} (+{limit.share:.2g} of it)" for limit in unmet[:MOST_NAMED]]
    more = [f"and {len(unmet) - MOST_NAMED} more"] if len(unmet) > MOST_NAMED else []
    return f"the motion found that asks least of the limits breaks these: {', '.join([*named, *more])}"


def _too_heavy(problem: Problem, program: Program, instance: Instance) -> str | None:
    load = torque_load(problem, program, instance)
    if load.share <= 1:
        return None
    k = load.joint
    whose = "the strongest motor within the bounds" if problem.design is None else "the given motor"
    return (
        f"even moving slowly, joint {k + 1} must hold {_number(load.needed[k])} N m; "
        f"{whose} gives at most {_number(load.available[k])} N m at {problem.motor.current_limit:.4g} A "
        f"through a gear of {problem.robot.gear_ratio[k]:g}"
    )


def _too_slow(
    problem: Problem,
    program: Program,
    climb: Climb,
    *,
    options: SolverOptions,
    progress: Progress | None,
    deadline: float,
) -> str | None:
    """The fastest motion without the task's latest final time, when there is one and it comes too late."""
    _, latest = problem.final_time_bounds
    longest = FINAL_TIME_BOUNDS[1]
    if latest >= longest:
        return None
    objective = Objective("time", final_time_bounds=(problem.final_time_bounds[0], longest))
    relaxed = replace(problem, objective=objective)
    start = Guess(climb.outcome.x)
    fastest = run(
        program,
        build_instance(relaxed, program),
        start,
        options,
        progress=progress,
        attempt=len(climb.attempts),
        deadline=deadline,
    )
    _, final_time, _ = program.split(fastest.x)
    if not fastest.success or final_time <= latest:
        return None
    motors = "with the given motors" if problem.design is not None else "with any motors"
    return f"the shortest motion found {motors} takes {final_time:.4g} s, and {latest:.4g} s are allowed"


def _largest_violation(problem: Problem, program: Program, instance: Instance, x: np.ndarray) -> str:
    """The group of constraints that the solver's last point violates most, in words."""
    g = program.nlp(x, instance.parameters)[1].full().ravel()
    outside = np.maximum(np.maximum(instance.lower_g - g, g - instance.upper_g), 0)
    worst = int(np.argmax(outside))
    first_motor = program.intervals * program.interval_constraints
    if worst >= first_motor:
        k, kind = divmod(worst - first_motor, len(CONSTRAINTS))
        limits = constraint_limits(problem.motor)
        limit = limits[0][kind] if np.isfinite(limits[0][kind]) else limits[1][kind]
        return f"motor {k + 1} breaks {CONSTRAINTS[kind]}: {g[worst]:.4g}, the limit is {limit:.4g}"
    interval, row = divmod(worst, program.interval_constraints)
    share = (interval + 1) / program.intervals
    return f"{_equation(problem, program, row, outside[worst])} {share:.0%} into the motion"


def _equation(problem: Problem, program: Program, row: int, amount: float) -> str:
    """An interval's constraint in words, `amount` [scaled] off."""
    layout, n, scales = program.layout, problem.robot.joints, scales_of(problem)
    group, k = divmod(row, n)
    per_point = layout.point_size // n
    if group >= layout.equalities // n + 2 * len(layout.voltage_checks):
        return f"the speed of joint {k + 1} is {amount * scales.speed[k]:.3g} rad/s over its limit between points"
    if group >= layout.equalities // n:
        return f"the voltage of motor {k + 1} is {amount * scales.voltage:.3g} V over its limit"
    if group >= layout.degree * per_point:
        return f"the state of joint {k + 1} is off by {amount:.3g} of its scale"
    kind = group % per_point
    if kind == 0:
        return f"speed and position of joint {k + 1} disagree by {amount:.3g} rad"
    if kind == 1:
        return f"motor {k + 1} misses the torque that joint {k + 1} needs by {amount * scales.torque[k]:.3g} N m"
    axis = "d" if kind == 2 else "q"
    return f"the {axis}-axis voltage of motor {k + 1} misses what its current needs by {amount * scales.voltage:.3g} V"


def _number(value: float) -> str:
    """Three significant digits, thousands apart."""
    return f"{float(f'{value:.3g}'):,g}" if value < 1e6 else f"{value:.3g}"
