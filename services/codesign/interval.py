"""One interval of the optimal control problem, symbolically: what the compiled kernels compute.

The whole program is this interval repeated. Everything that differs between tasks, motors, limits and grids is a
number handed in (`PARAMETERS`), so one kernel serves them all; only the arm's geometry and masses, the collocation
scheme and the kind of control shape the code.

All variables are scaled to order one. A state is (q, qd, i_d, i_q), each of shape (n,).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from services.codesign.arm import Arm, build_arm
from services.codesign.collocation import Collocation, collocation
from services.codesign.forward_dynamics import forward_dynamics
from services.codesign.inverse_dynamics import inverse_dynamics
from services.codesign.motor import MotorParameters, motor_parameters, motor_torque, steady_voltages
from services.codesign.motor_data import COEFFICIENTS, DIMENSIONS
from services.codesign.robot import Robot

Expression = Any

ROUNDING = 1e-12
"""Size below which a collocation weight is zero: a polynomial's value at one of its own nodes."""

CONTROLS = ("voltage", "current")
DYNAMICS = ("inverse", "forward")


@dataclass(frozen=True)
class IntervalLayout:
    """Where things lie in an interval's variables and constraints.

    Voltage control (the paper): the state at every point, then the interval's constant voltages.
    Current control: (q, qd) at every point, then the currents at the interval's end, linear in between; voltages
    follow from the motor's equations. They and the speeds are bounded between the points too (MODEL section 5).
    With Legendre points the state at the interval's end follows the points.
    """

    joints: int
    scheme: str
    degree: int
    control: str = "voltage"
    dynamics: str = "inverse"
    free_gears: tuple[int, ...] = ()  # joints whose gear ratio is part of the design, in rising order

    def __post_init__(self) -> None:
        collocation(self.scheme, self.degree)
        if self.control not in CONTROLS:
            raise ValueError(f"control {self.control!r}: must be one of {', '.join(CONTROLS)}")
        if self.dynamics not in DYNAMICS:
            raise ValueError(f"dynamics {self.dynamics!r}: must be one of {', '.join(DYNAMICS)}")

    @property
    def collocation(self) -> Collocation:
        """The scheme's points and matrices."""
        return collocation(self.scheme, self.degree)

    @property
    def design_size(self) -> int:
        """Numbers of a design: seven lengths a joint, then the gear ratios that are free, over the robot's."""
        return len(DIMENSIONS) * self.joints + len(self.free_gears)

    @property
    def has_end_state(self) -> bool:
        """Whether the interval's end is a variable of its own."""
        return not self.collocation.ends_on_point

    @property
    def state_size(self) -> int:
        """Size of the state carried from one interval to the next."""
        return 4 * self.joints

    @property
    def point_size(self) -> int:
        """Variables at one collocation point."""
        return (4 if self.control == "voltage" else 2) * self.joints

    @property
    def stops(self) -> int:
        """Points with variables: collocation points, and the end when it is not one of them."""
        return self.degree + (1 if self.has_end_state else 0)

    @property
    def variables(self) -> int:
        """Variables of one interval."""
        return self.point_size * self.stops + 2 * self.joints

    @property
    def equalities(self) -> int:
        """Equality constraints of one interval."""
        return self.point_size * self.stops

    @property
    def voltage_checks(self) -> tuple[float, ...]:
        """Shares of the interval at which voltages that follow from the currents are bounded: its ends and the points.

        The voltage jumps where the currents have a kink, so that the start needs a bound of its own.
        """
        return tuple(np.union1d([0.0, 1.0], self.collocation.points).tolist())

    @property
    def inequalities(self) -> int:
        """With current control: voltages at the checks, and speeds between the points."""
        if self.control == "voltage":
            return 0
        return self.joints * (2 * len(self.voltage_checks) + self.degree - 1)

    @property
    def end_state(self) -> list[int]:
        """Indices, within an interval's variables, of the state that the next interval starts from."""
        last = self.point_size * (self.stops - 1)
        if self.control == "voltage":
            return list(range(last, last + 4 * self.joints))
        currents = self.point_size * self.stops
        return [*range(last, last + 2 * self.joints), *range(currents, currents + 2 * self.joints)]


def parameter_sizes(joints: int) -> dict[str, int]:
    """Names and sizes of the numbers that a kernel takes, in order."""
    return {
        "coefficients": len(COEFFICIENTS),
        "design_scale": len(DIMENSIONS),
        "gear_ratio": joints,
        "payload": 1,
        "speed_scale": joints,
        "current_scale": 1,
        "voltage_scale": 1,
        "torque_scale": joints,
        "effort_weight": 1,
        "power_weight": 1,
    }


@dataclass(frozen=True)
class IntervalExpressions:
    """Inputs and outputs of one interval (SX)."""

    start: Expression  # (4n,) scaled state at the interval's start
    variables: Expression  # (layout.variables,)
    design: Expression  # (layout.design_size,) scaled
    final_time: Expression  # t_f [s]
    width: Expression  # share of t_f that the interval takes
    parameters: Expression
    constraints: Expression  # equalities (= 0), then inequalities (in -1..1)
    effort: Expression  # over the interval: effort_weight * integral of u'u + power_weight * electrical energy


def unpack_parameters(parameters: Expression, joints: int) -> dict[str, Expression]:
    """Split a parameter vector by `parameter_sizes`."""
    sizes = parameter_sizes(joints)
    offsets = [0]
    for size in sizes.values():
        offsets.append(offsets[-1] + size)
    return dict(zip(sizes, ca.vertsplit(parameters, offsets), strict=True))


def motors_of(design: Expression, p: dict[str, Expression], joints: int) -> list[MotorParameters]:
    """Parameters of every motor from the scaled design vector."""
    return [motor_parameters(design[7 * k : 7 * k + 7] * p["design_scale"], p["coefficients"]) for k in range(joints)]


def geared(p: dict[str, Expression], design: Expression, layout: IntervalLayout) -> dict[str, Expression]:
    """The parameters with the gear ratios that the design chooses, as shares of those given.

    Speeds are measured by the rotor's limit, omega_max / |Z|, and torques by Z, so both scales follow. Then limits on
    speeds stay bounds of variables, and a point with a share of 2 is the same as one with twice the ratio given.
    """
    if not layout.free_gears:
        return p
    share = ca.SX.ones(layout.joints)
    for place, joint in enumerate(layout.free_gears):
        share[joint] = design[len(DIMENSIONS) * layout.joints + place]
    follow = {name: p[name] * share for name in ("gear_ratio", "torque_scale")}
    return p | follow | {"speed_scale": p["speed_scale"] / share}


def stacked(motors: list[MotorParameters]) -> MotorParameters:
    """The same parameters as vectors over the joints."""
    return MotorParameters(*(ca.vertcat(*values) for values in zip(*motors, strict=True)))


@dataclass(frozen=True)
class _Plant:
    """The arm with its motors, as one interval sees them."""

    layout: IntervalLayout
    arm: Arm
    motor: MotorParameters  # vectors over the joints
    p: dict[str, Expression]  # by the names of `parameter_sizes`


def interval_expressions(robot: Robot, layout: IntervalLayout) -> IntervalExpressions:
    """Collocate one interval  (eqs. 1 and 4; Section III-B)."""
    n = layout.joints
    start = ca.SX.sym("start", layout.state_size)
    variables = ca.SX.sym("variables", layout.variables)
    design = ca.SX.sym("design", layout.design_size)
    final_time, width = ca.SX.sym("final_time"), ca.SX.sym("width")
    parameters = ca.SX.sym("parameters", sum(parameter_sizes(n).values()))

    p = geared(unpack_parameters(parameters, n), design, layout)
    motors = motors_of(design, p, n)
    arm = build_arm(robot, motors, p["payload"], p["gear_ratio"])
    h = final_time * width
    path = _voltage_path if layout.control == "voltage" else _current_path
    constraints, effort = path(_Plant(layout, arm, stacked(motors), p), start, variables, h)
    return IntervalExpressions(start, variables, design, final_time, width, parameters, constraints, effort)


def _voltage_path(
    plant: _Plant, start: Expression, variables: Expression, h: Expression
) -> tuple[Expression, Expression]:
    """The paper's transcription: voltages constant on the interval (eq. 6), all four kinds of states collocated."""
    layout, motor, p = plant.layout, plant.motor, plant.p
    n, scheme, P = layout.joints, layout.collocation, p["coefficients"][0]
    stops = [start, *(variables[4 * n * j : 4 * n * (j + 1)] for j in range(layout.stops))]
    points = stops[: layout.degree + 1]
    u = variables[4 * n * layout.stops :] * p["voltage_scale"]
    defects, effort = [], ca.SX(0)
    for j, row in enumerate(scheme.differentiation):
        x, slope = points[j + 1], _combine(row, points)
        q, qd, i_d, i_q = _physical(x, p, n)
        effort = effort + h * scheme.weights[j] * _running_cost(u, ca.vertcat(i_d, i_q), p)
        _, dqd, di_d, di_q = _physical(slope, p, n)
        defects.append(_kinematic_defect(x, slope, h, p, n))
        defects.append(_dynamic_defect(plant, q, qd, dqd / h, i_q))
        steady_d, steady_q = steady_voltages(i_d, i_q, p["gear_ratio"] * qd, motor, P)
        required = ca.vertcat(steady_d + motor.inductance * di_d / h, steady_q + motor.inductance * di_q / h)
        defects.append((required - u) / p["voltage_scale"])  # eq. (1)
    if layout.has_end_state:
        defects.append(stops[-1] - _combine(scheme.end, points))
    return ca.vertcat(*defects), effort


def _current_path(
    plant: _Plant, start: Expression, variables: Expression, h: Expression
) -> tuple[Expression, Expression]:
    """Currents linear on the interval; the voltage follows from eq. (1)  (MODEL section 5)."""
    layout, motor, p = plant.layout, plant.motor, plant.p
    n, scheme, P = layout.joints, layout.collocation, p["coefficients"][0]
    stops = [start[: 2 * n], *(variables[2 * n * j : 2 * n * (j + 1)] for j in range(layout.stops))]
    points = stops[: layout.degree + 1]
    first, last = start[2 * n :] * p["current_scale"], variables[2 * n * layout.stops :] * p["current_scale"]
    di = (last - first) / h

    def currents(share: float) -> Expression:
        return first + share * (last - first)

    def voltages(share: float, qd: Expression) -> Expression:
        """Eq. (1) along the ramp of the currents."""
        current = currents(share)
        steady_d, steady_q = steady_voltages(current[:n], current[n:], p["gear_ratio"] * qd, motor, P)
        return ca.vertcat(steady_d + motor.inductance * di[:n], steady_q + motor.inductance * di[n:])

    defects, effort = [], ca.SX(0)
    for j, row in enumerate(scheme.differentiation):
        x, slope = points[j + 1], _combine(row, points)
        q, qd = x[:n], x[n:] * p["speed_scale"]
        current = currents(scheme.points[j])
        defects.append(_kinematic_defect(x, slope, h, p, n))
        defects.append(_dynamic_defect(plant, q, qd, slope[n:] * p["speed_scale"] / h, current[n:]))
        u = voltages(scheme.points[j], qd)
        effort = effort + h * scheme.weights[j] * _running_cost(u, current, p)
    if layout.has_end_state:
        defects.append(stops[-1] - _combine(scheme.end, points))
    speeds = [stop[n:] for stop in points]  # scaled
    bounded = [
        voltages(share, _combine(scheme.at(share), speeds) * p["speed_scale"]) / p["voltage_scale"]
        for share in layout.voltage_checks
    ]
    # A polynomial lies between its Bernstein coefficients; the first and the last are its ends, bounded already.
    bounded += [_combine(row, speeds) for row in scheme.bernstein[1:-1]]
    return ca.vertcat(*defects, *bounded), effort


def demand_expressions(robot: Robot, layout: IntervalLayout) -> tuple[list[Expression], list[Expression]]:
    """Inputs and outputs of the map from a motion to what it asks of the motors, all scaled.

    (q [rad], qd [rad/s], qdd [rad/s2], design, parameters) -> (i_q, u_d, u_q), with i_d = 0 and the currents' rates
    left out; each output has shape (n,).
    """
    n = robot.joints
    q, qd, qdd = (ca.SX.sym(name, n) for name in ("q", "qd", "qdd"))
    design = ca.SX.sym("design", layout.design_size)
    parameters = ca.SX.sym("parameters", sum(parameter_sizes(n).values()))
    p = geared(unpack_parameters(parameters, n), design, layout)
    motors, P = motors_of(design, p, n), p["coefficients"][0]
    motor = stacked(motors)
    tau = inverse_dynamics(build_arm(robot, motors, p["payload"], p["gear_ratio"]), q, qd, qdd)
    i_q = tau / (p["gear_ratio"] * motor_torque(1, motor, P))
    steady_d, steady_q = steady_voltages(ca.SX.zeros(n), i_q, p["gear_ratio"] * qd, motor, P)
    outputs = [i_q / p["current_scale"], steady_d / p["voltage_scale"], steady_q / p["voltage_scale"]]
    return [q, qd, qdd, design, parameters], outputs


def _running_cost(u: Expression, current: Expression, p: dict[str, Expression]) -> Expression:
    """What an objective adds up over time: u'u, or the electrical power 3/2 u'i  (MODEL section 1)."""
    return p["effort_weight"] * ca.dot(u, u) + p["power_weight"] * 1.5 * ca.dot(u, current)


def _combine(row: Any, points: list[Expression]) -> Expression:
    """Weighted sum; weights that are zero but for rounding are left out, and with them their places in Jacobians."""
    pairs = zip(row, points, strict=True)
    return sum(float(weight) * point for weight, point in pairs if abs(weight) > ROUNDING)


def _physical(x: Expression, p: dict[str, Expression], n: int) -> tuple[Expression, ...]:
    """Scaled state -> q [rad], qd [rad/s], i_d [A], i_q [A]."""
    return x[:n], x[n : 2 * n] * p["speed_scale"], *(x[k * n : (k + 1) * n] * p["current_scale"] for k in (2, 3))


def _kinematic_defect(x: Expression, slope: Expression, h: Expression, p: dict[str, Expression], n: int) -> Expression:
    """h qd = polynomial's derivative of q, in units of the speed scale."""
    return h * x[n : 2 * n] * p["speed_scale"] - slope[:n]


def _dynamic_defect(plant: _Plant, q: Expression, qd: Expression, qdd: Expression, i_q: Expression) -> Expression:
    """Eq. (4): motor torque through the gear meets the arm.

    Departure 11 (docs/model.md): inverse dynamics is the fast path, the paper's forward dynamics the other
    (MODEL section 4).
    """
    layout, arm, p = plant.layout, plant.arm, plant.p
    tau = p["gear_ratio"] * motor_torque(i_q, plant.motor, p["coefficients"][0])
    if layout.dynamics == "forward":
        return (qdd - forward_dynamics(arm, q, qd, tau)) / p["speed_scale"]
    return (tau - inverse_dynamics(arm, q, qd, qdd)) / p["torque_scale"]
