"""What limits cost: how an optimum changes with each of its limits, from the multipliers  (envelope theorem).

With ``grad f + J' lam_g + lam_x = 0``, a bound that holds an optimum back has the multiplier of its constraint as the
optimum's slope in it: ``d f* / d upper = -lam`` where lam > 0, ``d f* / d lower = -lam`` where lam < 0. A limit that
enters many times (the current of every motor at every point) has the sum. Slopes are those of a small change, at the
motion's grid; the references of a weighted objective stay as they are.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from services.codesign.instance import TYPICAL_DESIGN, Instance, build_instance, objective_scale
from services.codesign.interval import IntervalLayout
from services.codesign.motor_data import CONSTRAINTS, DIMENSIONS, MotorData
from services.codesign.problem import Problem
from services.codesign.program import Program, load_program

BINDS = 1e-3
"""A limit binds when changing it by a small share changes the optimum by more than this times that share: interior
points leave a trace of every limit."""

MM = 1e-3


@dataclass(frozen=True)
class LimitSlope:
    """One limit of one optimum."""

    slope: float  # d objective / d limit: the objective's unit per unit of the limit
    binds: bool


@dataclass(frozen=True)
class _Limit:
    value: float  # what a share of it is taken of
    slope: float


def limit_slopes(problem: Problem, objective: float, lam_x: np.ndarray, lam_g: np.ndarray) -> dict[str, LimitSlope]:
    """Slopes of an optimum, by the limit's name in a request: ``current_limit_A``, ``bounds_mm.L.high``, ...

    Limits of the design are there when the design was free. A duration that was given is among the limits.

    Parameters
    ----------
    objective
        The optimum, in the problem's unit.
    lam_x, lam_g
        Its multipliers, of the program on the problem's grid.
    """
    program = load_program(problem.robot, problem.layout, problem.transcription.intervals)
    instance = build_instance(problem, program)
    scale = objective_scale(problem)
    limits = dict(_motion_limits(problem, program, instance, lam_x / scale, lam_g / scale))
    if problem.design is None:
        own = slice(program.design_size)
        limits |= design_limits(problem.motor, lam_x[own] / scale, _of_motors(program, lam_g) / scale)
    return _judged(limits, objective)


def design_slopes(
    motor: MotorData, objective: float, lam_design: np.ndarray, lam_motors: np.ndarray
) -> dict[str, LimitSlope]:
    """Slopes of an optimum in the limits of its design alone: ``lam_design`` (7n,), ``lam_motors`` (6n,)."""
    return _judged(design_limits(motor, lam_design, lam_motors), objective)


def _judged(limits: Mapping[str, _Limit], objective: float) -> dict[str, LimitSlope]:
    return {
        name: LimitSlope(limit.slope, abs(limit.slope * limit.value) > BINDS * abs(objective))
        for name, limit in limits.items()
    }


def _of_motors(program: Program, lam_g: np.ndarray) -> np.ndarray:
    return lam_g[program.intervals * program.interval_constraints :]


def _motion_limits(
    problem: Problem, program: Program, instance: Instance, lam_x: np.ndarray, lam_g: np.ndarray
) -> Iterator[tuple[str, _Limit]]:
    """Limits (3a), (3b), (5a)-(5c) and those of t_f; the given end state is none."""
    layout, motor, robot = program.layout, problem.motor, problem.robot
    free = instance.lower_x != instance.upper_x
    pulls = np.abs(np.where(free, lam_x, 0.0))[program.time_index + 1 :].reshape(program.intervals, -1).sum(axis=0)
    held = np.abs(lam_g[: program.intervals * program.interval_constraints])
    checks = held.reshape(program.intervals, -1).sum(axis=0)[layout.equalities :]
    parts = _by_kind(layout, pulls, checks)
    yield "current_limit_A", _Limit(motor.current_limit, -float(parts["current"].sum()) / motor.current_limit)
    yield "voltage_limit_V", _Limit(motor.voltage_limit, -float(parts["voltage"].sum()) / motor.voltage_limit)
    rotor = robot.rotor_speed_limit
    by_rotor = robot.joint_speed_limit < robot.joint_speed_bound
    yield "rotor_speed_limit_rad_s", _Limit(rotor, -float(parts["speed"][by_rotor].sum()) / rotor)
    for k in np.flatnonzero(~by_rotor):
        bound = float(robot.joint_speed_bound[k])
        yield f"joint_speed_limit_rad_s.{k + 1}", _Limit(bound, -float(parts["speed"][k]) / bound)
    for k, pull in enumerate(parts["position"]):
        yield f"joint_position_limit_rad.{k + 1}", _Limit(1.0, -float(pull))
    yield from _time_limits(problem, float(lam_x[program.time_index]))


def _time_limits(problem: Problem, lam: float) -> Iterator[tuple[str, _Limit]]:
    low, high = problem.final_time_bounds
    if low == high:
        yield "duration_s", _Limit(high, -lam)
    else:
        yield "final_time_bounds_s.low", _Limit(low, max(-lam, 0.0))
        yield "final_time_bounds_s.high", _Limit(high, -max(lam, 0.0))


def _by_kind(layout: IntervalLayout, pulls: np.ndarray, checks: np.ndarray) -> dict[str, np.ndarray]:
    """Multipliers, summed over the intervals, by what they hold: each a vector over the joints."""
    n = layout.joints
    points = pulls[: layout.point_size * layout.stops].reshape(layout.stops, layout.point_size).sum(axis=0)
    tail = pulls[layout.point_size * layout.stops :].reshape(2, n).sum(axis=0)
    parts = {"position": points[:n], "speed": points[n : 2 * n]}
    if layout.control == "voltage":
        return parts | {"current": points[2 * n : 3 * n] + points[3 * n :], "voltage": tail}
    voltages = 2 * n * len(layout.voltage_checks)
    between = checks[voltages:].reshape(-1, n).sum(axis=0)  # speeds between the points
    return parts | {
        "current": tail,
        "voltage": checks[:voltages].reshape(-1, n).sum(axis=0),
        "speed": parts["speed"] + between,
    }


def design_limits(motor: MotorData, lam_design: np.ndarray, lam_motors: np.ndarray) -> dict[str, _Limit]:
    """Limits (2a)-(2e) and (3c), each for all motors together; lengths in mm."""
    lengths = lam_design.reshape(-1, len(DIMENSIONS)) / (TYPICAL_DESIGN / MM)
    limits = {}
    for name, lam in zip(DIMENSIONS, lengths.T, strict=True):
        low, high = motor.bounds[name]
        limits[f"bounds_mm.{name}.low"] = _Limit(low / MM, float(np.maximum(-lam, 0).sum()))
        limits[f"bounds_mm.{name}.high"] = _Limit(high / MM, -float(np.maximum(lam, 0).sum()))
    lam = dict(zip(CONSTRAINTS, lam_motors.reshape(-1, len(CONSTRAINTS)).sum(axis=0), strict=True))
    wire = motor.wire_diameter_min / MM
    flux = lam["tooth_flux_density_T"] + lam["yoke_flux_density_T"]
    return limits | {
        "tooth_width_rad": _Limit(math.pi / motor.slots, -float(lam["tooth_width_rad"])),
        "slot_height_min_mm": _Limit(motor.slot_height_min / MM, -float(lam["slot_height_mm"])),
        "mass_limit_kg": _Limit(motor.mass_limit, -float(lam["mass_kg"])),
        "wire_diameter_min_mm": _Limit(wire, -float(lam["wire_diameter_squared_mm2"]) * 2 * wire),
        "flux_density_limit_T": _Limit(motor.flux_density_limit, -float(flux)),
    }
