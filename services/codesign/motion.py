"""A motion on its grid, and how it is read out of a program's variables."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from services.codesign.instance import scales_of
from services.codesign.motor import MotorParameters, evaluate_motors, motor_torque, steady_voltages
from services.codesign.problem import Problem
from services.codesign.program import Program


@dataclass(frozen=True)
class Motion:
    """States, currents, voltages and joint torques of one motion; every array but `time` is (points, n), SI.

    The first point is the start; then come, interval by interval, the collocation points (and the interval's end
    where that is not one of them). `weights` integrates over time: ``sum(weights * f(points))``; it is zero at
    points that are not collocation points.
    """

    time: np.ndarray  # (points,) s
    weights: np.ndarray  # (points,) s
    position: np.ndarray  # rad
    speed: np.ndarray  # rad/s
    current_d: np.ndarray  # A
    current_q: np.ndarray  # A
    voltage_d: np.ndarray  # V
    voltage_q: np.ndarray  # V
    torque: np.ndarray  # N m, link side

    @property
    def final_time(self) -> float:
        """t_f [s]."""
        return float(self.time[-1])


def motors_of_design(design: np.ndarray, problem: Problem) -> MotorParameters:
    """Motor parameters as arrays over the joints, from a design of shape (n, 7) in m."""
    return evaluate_motors(design, problem.motor)


def with_gears_of(problem: Problem, program: Program, x: np.ndarray) -> Problem:
    """The problem with the gear ratios that a point has chosen as the robot's."""
    if not program.layout.free_gears:
        return problem
    return replace(problem, robot=problem.robot.with_gears(problem.robot.gear_ratio * program.gear_shares(x)))


def read_motion(problem: Problem, program: Program, x: np.ndarray) -> Motion:
    """The motion that a program's variables describe."""
    layout, scheme, N, n = program.layout, program.layout.collocation, program.intervals, problem.robot.joints
    problem = with_gears_of(problem, program, x)
    scales = scales_of(problem)
    design, final_time, z = program.split(x)
    h = final_time * problem.transcription.shares
    starts = np.concatenate([[0.0], np.cumsum(h)])
    stop_shares = np.concatenate([scheme.points, [1.0]])[: layout.stops]
    time = np.concatenate([[0.0], (starts[:-1, None] + h[:, None] * stop_shares).ravel()])
    point_weights = np.concatenate([scheme.weights, [0.0]])[: layout.stops]
    weights = np.concatenate([[0.0], (h[:, None] * point_weights).ravel()])

    motor, P = motors_of_design(design * scales.design, problem), problem.motor.pole_pairs
    stops = z[:, : layout.point_size * layout.stops].reshape(N, layout.stops, layout.point_size)
    tail = z[:, layout.point_size * layout.stops :]
    position = _with_start(stops[:, :, :n], problem.task.start)
    speed = _with_start(stops[:, :, n : 2 * n] * scales.speed, problem.task.start_velocity)
    if layout.control == "voltage":
        currents = _with_start(stops[:, :, 2 * n :] * scales.current, np.zeros(2 * n))
        held = np.repeat(tail[:, None, :] * scales.voltage, layout.stops, axis=1)
        voltages = _with_start(held, held[0, 0])
    else:
        nodes = np.vstack([np.zeros(2 * n), tail * scales.current])
        slope = np.diff(nodes, axis=0) / h[:, None]
        inside = nodes[:-1, None, :] + stop_shares[None, :, None] * np.diff(nodes, axis=0)[:, None, :]
        currents = _with_start(inside, nodes[0])
        slopes = np.vstack([slope[0], np.repeat(slope, layout.stops, axis=0)])
        rates = motor.inductance * slopes.reshape(-1, 2, n)
        steady = steady_voltages(currents[:, :n], currents[:, n:], problem.robot.gear_ratio * speed, motor, P)
        voltages = np.hstack([steady[0] + rates[:, 0], steady[1] + rates[:, 1]])
    torque = problem.robot.gear_ratio * motor_torque(currents[:, n:], motor, P)
    return Motion(
        time=time,
        weights=weights,
        position=position,
        speed=speed,
        current_d=currents[:, :n],
        current_q=currents[:, n:],
        voltage_d=voltages[:, :n],
        voltage_q=voltages[:, n:],
        torque=torque,
    )


def _with_start(stops: np.ndarray, start: np.ndarray) -> np.ndarray:
    """(N, stops, m) behind the start (m,) -> (1 + N stops, m)."""
    return np.vstack([start, stops.reshape(-1, stops.shape[-1])])
