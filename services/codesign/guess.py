"""Where a solve starts: a motion that obeys the dynamics, or a motion known from a neighbouring solve.

Departure 9 (docs/model.md): the paper starts at mid-bounds and zero voltage; that, and a straight line, fail on up
to 10 of the 25 tasks  (MODEL section 4). The dynamic guess is a quintic motion with the currents and voltages that
inverse dynamics says it needs, in the shortest time in which they stay within their limits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from services.codesign.evaluate import evaluate
from services.codesign.instance import Instance, scales_of
from services.codesign.interval import parameter_sizes
from services.codesign.kernels import Kernels
from services.codesign.motion import Motion
from services.codesign.problem import Problem
from services.codesign.program import Program
from services.codesign.reconcile import feasible_design

TIME_SEARCH_POINTS = 21
TIME_SEARCH_STEPS = 40
TIME_SEARCH_TOLERANCE = 1e-6  # of what a limit has to spare at the time found


@dataclass(frozen=True)
class Guess:
    """A point of the program to start from."""

    x: np.ndarray
    lam_x: np.ndarray | None = None
    lam_g: np.ndarray | None = None


@dataclass(frozen=True)
class MotionPoint:
    """A motion as a program has it, scaled, with its multipliers; apart from the design that it is made with."""

    x: np.ndarray  # t_f, then the intervals' variables
    lam_x: np.ndarray  # of the same
    lam_g: np.ndarray  # of the intervals' constraints


def starting_design(problem: Problem) -> np.ndarray:
    """The design that the first rungs start from, (n, 7) [m]: the given one, or one well inside the feasible set."""
    if problem.design is not None:
        return problem.design
    return np.tile(feasible_design(problem.motor), (problem.robot.joints, 1))


def quintic(problem: Problem, final_time: float, share: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fifth-degree motion between the task's states with no acceleration at its ends.

    Parameters
    ----------
    share
        Shape (m,), time as a share of `final_time`, 0..1.

    Returns
    -------
    tuple
        q [rad], qd [rad/s], qdd [rad/s2], each of shape (m, n).
    """
    task, T, s = problem.task, final_time, share[:, None]
    v_0, v_1 = task.start_velocity * T, task.end_velocity * T
    gap = task.end - task.start
    a_3, a_4, a_5 = 10 * gap - 6 * v_0 - 4 * v_1, -15 * gap + 8 * v_0 + 7 * v_1, 6 * gap - 3 * v_0 - 3 * v_1
    q = task.start + v_0 * s + a_3 * s**3 + a_4 * s**4 + a_5 * s**5
    qd = (v_0 + 3 * a_3 * s**2 + 4 * a_4 * s**3 + 5 * a_5 * s**4) / T
    qdd = (6 * a_3 * s + 12 * a_4 * s**2 + 20 * a_5 * s**3) / T**2
    return q, qd, qdd


def quintic_guess(
    problem: Problem, program: Program, instance: Instance, design: np.ndarray, time_factor: float = 1.0
) -> Guess:
    """Dynamic guess with a design of shape (n, 7) [m], its motion time stretched by `time_factor`."""
    low, high = problem.final_time_bounds
    shortest = low if low == high else _shortest_time(problem, program, instance, design)
    final_time = float(np.clip(time_factor * shortest, low, high))
    stops, tails = _shares(problem)
    q, qd, _ = quintic(problem, final_time, stops)
    i_q, u_d, u_q = motor_demand(problem, program, instance, design, quintic(problem, final_time, stops))
    states = [q, qd / scales_of(problem).speed]
    if program.layout.control == "voltage":
        states += [np.zeros_like(i_q), i_q]
        _, u_d, u_q = motor_demand(problem, program, instance, design, quintic(problem, final_time, tails))
        tail = np.hstack([u_d, u_q])
    else:
        i_q, _, _ = motor_demand(problem, program, instance, design, quintic(problem, final_time, tails))
        tail = np.hstack([np.zeros_like(i_q), i_q])
    return Guess(
        _assemble(problem, program, instance, design, final_time=final_time, states=np.hstack(states), tail=tail)
    )


def motion_guess(problem: Problem, program: Program, instance: Instance, design: np.ndarray, motion: Motion) -> Guess:
    """Start from a known motion, on any grid, with a design of shape (n, 7) [m]."""
    scales, (stops, tails) = scales_of(problem), _shares(problem)
    low, high = problem.final_time_bounds
    known = motion.time / motion.final_time

    def at(values: np.ndarray, share: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(share, known, column) for column in values.T])

    states = [at(motion.position, stops), at(motion.speed, stops) / scales.speed]
    if program.layout.control == "voltage":
        states += [at(motion.current_d, stops) / scales.current, at(motion.current_q, stops) / scales.current]
        tail = np.hstack([at(motion.voltage_d, tails), at(motion.voltage_q, tails)]) / scales.voltage
    else:
        tail = np.hstack([at(motion.current_d, tails), at(motion.current_q, tails)]) / scales.current
    final_time = float(np.clip(motion.final_time, low, high))
    return Guess(
        _assemble(problem, program, instance, design, final_time=final_time, states=np.hstack(states), tail=tail)
    )


def point_guess(problem: Problem, program: Program, point: MotionPoint) -> Guess:
    """Start where another program of the same grid ended, with the design that the problem gives.

    Raises
    ------
    ValueError
        For a problem that leaves its design free.
    """
    if problem.design is None:
        raise ValueError("a motion's point is a start for a problem with a given design")
    lengths = (problem.design / scales_of(problem).design).ravel()
    unbound = np.zeros(program.constraints - len(point.lam_g))  # a given design is not judged again (`instance`)
    return Guess(
        x=np.concatenate([lengths, point.x]),
        lam_x=np.concatenate([np.zeros(len(lengths)), point.lam_x]),
        lam_g=np.concatenate([point.lam_g, unbound]),
    )


def _shares(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Shares of t_f at the stops, (N stops,), and at the intervals' ends where the last N variables belong, (N,)."""
    layout, widths = problem.layout, problem.transcription.shares
    inside = np.concatenate([layout.collocation.points, [1.0]])[: layout.stops]
    ends = np.cumsum(widths)
    stops = (ends - widths)[:, None] + widths[:, None] * inside
    return stops.ravel(), ends


def _assemble(
    problem: Problem,
    program: Program,
    instance: Instance,
    design: np.ndarray,
    *,
    final_time: float,
    states: np.ndarray,
    tail: np.ndarray,
) -> np.ndarray:
    """Lay states (N stops, point size) and tails (N, 2n) into x, and clip to the bounds."""
    N = program.intervals
    intervals = np.hstack([states.reshape(N, -1), tail])
    x = program.join(design / scales_of(problem).design, final_time, intervals)
    clipped: np.ndarray = np.clip(x, instance.lower_x, instance.upper_x)
    return clipped


def motor_demand(
    problem: Problem,
    program: Program,
    instance: Instance,
    design: np.ndarray,
    motion: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What a motion (q, qd, qdd), each (m, n), asks of the motors: scaled (i_q, u_d, u_q), each (m, n)."""
    q, qd, qdd = motion
    parameters = instance.parameters[: sum(parameter_sizes(problem.robot.joints).values())]
    scaled = np.append(design / scales_of(problem).design, np.ones(len(program.layout.free_gears)))
    demand = _demand_at(program.kernels, len(q))
    i_q, u_d, u_q = (part.T for part in evaluate(demand, q.T, qd.T, qdd.T, scaled, parameters))
    return i_q, u_d, u_q


@lru_cache(maxsize=16)
def _demand_at(kernels: Kernels, points: int) -> ca.Function:
    return kernels.demand.map("demand", "serial", points, [3, 4], [])


def _shortest_time(problem: Problem, program: Program, instance: Instance, design: np.ndarray) -> float:
    """Shortest t_f [s] in which the quintic keeps speeds, currents and voltages within their limits.

    Where no time will do (gravity alone asks for too much), the fastest in which the speeds fit.
    """
    share = np.linspace(0, 1, TIME_SEARCH_POINTS)
    speed_limit = scales_of(problem).speed

    def load(final_time: float) -> float:
        motion = quintic(problem, final_time, share)
        parts = (motion[1] / speed_limit, *motor_demand(problem, program, instance, design, motion))
        return float(max(np.abs(part).max() for part in parts))

    low, high = problem.final_time_bounds
    if load(high) > 1:
        distance = np.abs(problem.task.end - problem.task.start) / speed_limit
        return float(np.clip(2 * distance.max(), low, high))
    return _where_it_falls_to_one(load, low, high)


def _where_it_falls_to_one(load: Callable[[float], float], low: float, high: float) -> float:
    """Smallest time in [low, high] with a load of at most 1, for a load that falls with time and is that small at high.

    Loads go about with a power of time, so it is sought by regula falsi in logarithms, in the Illinois way: an end that
    stays twice counts half.
    """
    above, below = _logarithm(load(low)), min(_logarithm(load(high)), 0.0)
    if above <= 0:
        return low
    x_above, x_below, stayed = np.log(low), np.log(high), 0
    best = float(high)
    for _ in range(TIME_SEARCH_STEPS):
        x = (x_above * below - x_below * above) / (below - above)
        found = _logarithm(load(np.exp(x)))
        if found > 0:
            x_above, above, below, stayed = x, found, below / 2 if stayed > 0 else below, 1
        else:
            best = float(np.exp(x))
            x_below, below, above, stayed = x, found, above / 2 if stayed < 0 else above, -1
        if -TIME_SEARCH_TOLERANCE <= found <= 0:
            break
    return best


def _logarithm(load: float) -> float:
    return float(np.log(max(load, 1e-300)))
