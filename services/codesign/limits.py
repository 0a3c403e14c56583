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
from services.codesign.program import Program, program_of

BINDS = 1e-3
"""A limit binds when changing it by a small share changes the optimum by more than this times that share: interior
points leave a trace of every limit."""

MM = 1e-3

UNITS = {"_rad_s": "rad/s", "_rad": "rad", "_mm": "mm", "_kg": "kg", "_A": "A", "_V": "V", "_T": "T", "_s": "s"}
"""By the end of a limit's name."""


@dataclass(frozen=True)
class LimitSlope:
    """One limit of one optimum."""

    value: float
    slope: float  # d objective / d limit: the objective's unit per unit of the limit
    span: float  # what a share of the limit is taken of: its size, or a joint's range

    def binds(self, objective: float) -> bool:
        """Whether it holds an optimum of this value back."""
        return abs(self.slope * self.span) > BINDS * abs(objective)


def binding(limits: Mapping[str, LimitSlope], objective: float) -> dict[str, LimitSlope]:
    """The limits that hold an optimum of this value back."""
    return {name: limit for name, limit in limits.items() if limit.binds(objective)}


def unit_of(name: str) -> str:
    """Unit of a limit, by its name."""
    field = name.split(".", maxsplit=1)[0]
    return next(unit for end, unit in UNITS.items() if field.endswith(end))


def limit_slopes(problem: Problem, lam_x: np.ndarray, lam_g: np.ndarray) -> dict[str, LimitSlope]:
    """Slopes of an optimum, by the limit's name in a request: ``current_limit_A``, ``bounds_mm.L.high``, ...

    Limits of the design are there when the design was free. A duration that was given is among the limits.

    Parameters
    ----------
    lam_x, lam_g
        The optimum's multipliers, of the program on the problem's grid.
    """
    program = program_of(problem)
    instance = build_instance(problem, program)
    lam_x, lam_g = lam_x / objective_scale(problem), lam_g / objective_scale(problem)
    of_motors = program.intervals * program.interval_constraints
    limits = dict(_motion_limits(problem, program, instance, lam_x, lam_g[:of_motors]))
    if problem.design is None:
        limits |= design_slopes(problem.motor, lam_x[: program.lengths], lam_g[of_motors:])
    return limits


def design_slopes(motor: MotorData, lam_design: np.ndarray, lam_motors: np.ndarray) -> dict[str, LimitSlope]:
    """Slopes in limits (2a)-(2e) and (3c), each for all motors together.

    Parameters
    ----------
    lam_design, lam_motors
        Multipliers of the scaled lengths, shape (7m,), and of the design constraints, shape (6m,), of the objective
        in its own unit.
    """
    lengths = lam_design.reshape(-1, len(DIMENSIONS)) / (TYPICAL_DESIGN / MM)
    limits = {}
    for name, lam in zip(DIMENSIONS, lengths.T, strict=True):
        low, high = motor.bounds[name]
        limits[f"bounds_mm.{name}.low"] = _limit(low / MM, _of_lower(lam))
        limits[f"bounds_mm.{name}.high"] = _limit(high / MM, _of_upper(lam))
    sums = dict(zip(CONSTRAINTS, lam_motors.reshape(-1, len(CONSTRAINTS)).sum(axis=0), strict=True))
    wire = motor.wire_diameter_min / MM
    flux = sums["tooth_flux_density_T"] + sums["yoke_flux_density_T"]
    return limits | {
        "tooth_width_rad": _limit(math.pi / motor.slots, -float(sums["tooth_width_rad"])),
        "slot_height_min_mm": _limit(motor.slot_height_min / MM, -float(sums["slot_height_mm"])),
        "mass_limit_kg": _limit(motor.mass_limit, -float(sums["mass_kg"])),
        "wire_diameter_min_mm": _limit(wire, -float(sums["wire_diameter_squared_mm2"]) * 2 * wire),
        "flux_density_limit_T": _limit(motor.flux_density_limit, -float(flux)),
    }


def _limit(value: float, slope: float) -> LimitSlope:
    return LimitSlope(value, slope, abs(value))


def _of_lower(lam: np.ndarray) -> float:
    """Slope in a lower bound, from the multipliers of all that it holds."""
    return float(np.maximum(-lam, 0).sum())


def _of_upper(lam: np.ndarray) -> float:
    return -float(np.maximum(lam, 0).sum())


def _motion_limits(
    problem: Problem, program: Program, instance: Instance, lam_x: np.ndarray, lam_g: np.ndarray
) -> Iterator[tuple[str, LimitSlope]]:
    """Limits (3a), (3b), (5a)-(5c) and those of t_f; the given end state is none."""
    layout, motor, robot = program.layout, problem.motor, problem.robot
    free = instance.lower_x != instance.upper_x
    pulls = np.where(free, lam_x, 0.0)[program.time_index + 1 :].reshape(program.intervals, -1)
    held = lam_g.reshape(program.intervals, -1)[:, layout.equalities :]
    parts = _by_kind(layout, np.abs(pulls).sum(axis=0), np.abs(held).sum(axis=0))
    # In units of these limits both ends are 1.
    yield "current_limit_A", _limit(motor.current_limit, -float(parts["current"].sum()) / motor.current_limit)
    yield "voltage_limit_V", _limit(motor.voltage_limit, -float(parts["voltage"].sum()) / motor.voltage_limit)
    rotor = robot.rotor_speed_limit
    by_rotor = robot.joint_speed_limit < robot.joint_speed_bound
    yield "rotor_speed_limit_rad_s", _limit(rotor, -float(parts["speed"][by_rotor].sum()) / rotor)
    for k in np.flatnonzero(~by_rotor).tolist():
        bound = float(robot.joint_speed_bound[k])
        yield f"joint_speed_limit_rad_s.{k + 1}", _limit(bound, -float(parts["speed"][k]) / bound)
    positions = _positions(layout, pulls)
    for k, (low, high) in enumerate(zip(robot.joint_lower.tolist(), robot.joint_upper.tolist(), strict=True)):
        yield f"joint_position_limit_rad.{k + 1}.low", LimitSlope(low, _of_lower(positions[..., k]), high - low)
        yield f"joint_position_limit_rad.{k + 1}.high", LimitSlope(high, _of_upper(positions[..., k]), high - low)
    yield from _time_limits(problem, lam_x[[program.time_index]])


def _time_limits(problem: Problem, lam: np.ndarray) -> Iterator[tuple[str, LimitSlope]]:
    low, high = problem.final_time_bounds
    if low == high:
        yield "duration_s", _limit(high, -float(lam[0]))
    else:
        yield "final_time_bounds_s.low", _limit(low, _of_lower(lam))
        yield "final_time_bounds_s.high", _limit(high, _of_upper(lam))


def _positions(layout: IntervalLayout, pulls: np.ndarray) -> np.ndarray:
    """Multipliers of the positions at every point, shape (N, stops, n)."""
    points = pulls[:, : layout.point_size * layout.stops].reshape(-1, layout.stops, layout.point_size)
    return points[..., : layout.joints]


def _by_kind(layout: IntervalLayout, pulls: np.ndarray, checks: np.ndarray) -> dict[str, np.ndarray]:
    """Multipliers, summed over the intervals, by what they hold: each a vector over the joints."""
    n = layout.joints
    points = pulls[: layout.point_size * layout.stops].reshape(layout.stops, layout.point_size).sum(axis=0)
    tail = pulls[layout.point_size * layout.stops :].reshape(2, n).sum(axis=0)
    speed = points[n : 2 * n]
    if layout.control == "voltage":
        return {"speed": speed, "current": points[2 * n : 3 * n] + points[3 * n :], "voltage": tail}
    voltages = 2 * n * len(layout.voltage_checks)
    between = checks[voltages:].reshape(-1, n).sum(axis=0)
    return {"speed": speed + between, "current": tail, "voltage": checks[:voltages].reshape(-1, n).sum(axis=0)}
