"""Numbers of one problem for its program: scales, parameters, bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from services.codesign.motor import constraint_limits
from services.codesign.motor_data import CONSTRAINTS
from services.codesign.problem import Problem
from services.codesign.program import Program

TYPICAL_DESIGN = np.array([60, 20, 45, 3, 7, 9, 3]) * 1e-3
"""Scale [m] of the seven lengths: about the middle of the designs that occur."""

TYPICAL_FLUX_LINKAGE = 0.1
"""Scale [Wb] for joint torques."""

EFFORT_SCALE = 1e-2
"""Weight per V2 s that brings the energy objective to order one (MODEL section 4)."""

ELECTRICAL_SCALE = 1e-1
"""Weight per J that brings electrical energy to order one."""

WEIGHTED_SCALE = 10.0
"""Factor of the weighted objective: near alpha = 1 it is far below one, and would stop 0.2 percent high."""


@dataclass(frozen=True)
class Scales:
    """Physical value of 1 in each scaled variable."""

    design: np.ndarray  # (7,) m
    speed: np.ndarray  # (n,) rad/s
    current: float  # A
    voltage: float  # V
    torque: np.ndarray  # (n,) N m

    def state(self) -> np.ndarray:
        """Scale of a state (q, qd, i_d, i_q), shape (4n,)."""
        n = len(self.speed)
        return np.concatenate([np.ones(n), self.speed, np.full(2 * n, self.current)])


@dataclass(frozen=True)
class Instance:
    """What the solver is handed besides the program and a guess."""

    parameters: np.ndarray
    lower_x: np.ndarray
    upper_x: np.ndarray
    lower_g: np.ndarray
    upper_g: np.ndarray


def scales_of(problem: Problem) -> Scales:
    """Scales from the limits, so that every bound is of order one."""
    robot, motor = problem.robot, problem.motor
    torque = 1.5 * motor.pole_pairs * TYPICAL_FLUX_LINKAGE * motor.current_limit * np.abs(robot.gear_ratio)
    return Scales(TYPICAL_DESIGN, robot.joint_speed_limit, motor.current_limit, motor.voltage_limit, torque)


def build_instance(problem: Problem, program: Program) -> Instance:
    """Assemble parameters and bounds."""
    scales = scales_of(problem)
    lower_x, upper_x = _variable_bounds(problem, program, scales)
    lower_g, upper_g = _constraint_bounds(problem, program)
    robot, motor, task = problem.robot, problem.motor, problem.task
    start = np.concatenate([task.start, task.start_velocity, np.zeros(2 * robot.joints)]) / scales.state()
    parameters = np.concatenate(
        [
            motor.coefficients(),
            scales.design,
            robot.gear_ratio,
            [task.payload],
            scales.speed,
            [scales.current],
            [scales.voltage],
            scales.torque,
            [0.0, 1.0] if problem.objective.kind == "electrical_energy" else [1.0, 0.0],
            start,
            problem.transcription.shares,
            objective_weights(problem),
        ]
    )
    return Instance(parameters, lower_x, upper_x, lower_g, upper_g)


def objective_weights(problem: Problem) -> tuple[float, float]:
    """Weights of t_f [1/s] and of what is added up over time in the program, `objective_scale` included.

    The latter is the integral of u'u [V2 s], or for `electrical_energy` that energy [J].

    Raises
    ------
    ValueError
        For a weighted objective without its references (`solve.with_references`).
    """
    objective, scale = problem.objective, objective_scale(problem)
    if objective.kind == "time":
        return scale, 0.0
    if objective.has_given_duration:
        return 0.0, scale
    if objective.time_reference is None or objective.effort_reference is None:
        raise ValueError("the weighted objective needs time_reference and effort_reference")
    weights = (1 - objective.alpha) / objective.time_reference, objective.alpha / objective.effort_reference
    return scale * weights[0], scale * weights[1]


def objective_scale(problem: Problem) -> float:
    """The program's objective over the problem's."""
    scales = {"time": 1.0, "energy": EFFORT_SCALE, "weighted": WEIGHTED_SCALE, "electrical_energy": ELECTRICAL_SCALE}
    return scales[problem.objective.kind]


def _variable_bounds(problem: Problem, program: Program, scales: Scales) -> tuple[np.ndarray, np.ndarray]:
    """Bounds (2a), (3a), (3b), (5a)-(5c) on x; the final state is pinned, and so is a given design."""
    n, motor = problem.robot.joints, problem.motor
    if problem.design is None:
        design_low = np.tile(motor.lower / scales.design, (n, 1))
        design_high = np.tile(motor.upper / scales.design, (n, 1))
    else:
        design_low = design_high = problem.design / scales.design
    low, high = _interval_bounds(problem, program)
    lower, upper = (np.tile(bound, (program.intervals, 1)) for bound in (low, high))
    end = np.concatenate([problem.task.end, problem.task.end_velocity / scales.speed])
    last = program.layout.end_state[: 2 * n]
    lower[-1, last] = upper[-1, last] = end
    time_low, time_high = problem.final_time_bounds
    gear_low, gear_high = _gear_bounds(problem)
    return (
        program.join(design_low, time_low, lower, gear_low),
        program.join(design_high, time_high, upper, gear_high),
    )


def _gear_bounds(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the free gear ratios over the robot's."""
    free = [gear for gear in problem.freedom.gears if gear.joint in problem.free_gears]
    ratio = np.abs(problem.robot.gear_ratio[[gear.joint for gear in free]]) if free else np.empty(0)
    return np.array([gear.low for gear in free]) / ratio, np.array([gear.high for gear in free]) / ratio


def _interval_bounds(problem: Problem, program: Program) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of one interval's variables, scaled: speeds, currents and voltages lie in -1..1."""
    robot, layout = problem.robot, program.layout
    extra = np.ones(layout.point_size - robot.joints)
    low = np.concatenate([robot.joint_lower, -extra])
    high = np.concatenate([robot.joint_upper, extra])
    tail = np.ones(2 * robot.joints)  # voltages, or currents at the interval's end
    return (
        np.concatenate([np.tile(low, layout.stops), -tail]),
        np.concatenate([np.tile(high, layout.stops), tail]),
    )


def _constraint_bounds(problem: Problem, program: Program) -> tuple[np.ndarray, np.ndarray]:
    layout = program.layout
    interval_low = np.concatenate([np.zeros(layout.equalities), -np.ones(layout.inequalities)])
    motor_low, motor_high = constraint_limits(problem.motor)
    if problem.design is not None:  # a given design is not judged again: rounding must not make a motion infeasible
        motor_low, motor_high = np.full(len(CONSTRAINTS), -np.inf), np.full(len(CONSTRAINTS), np.inf)
    N, motors = program.intervals, program.motor_constraints // len(CONSTRAINTS)
    return (
        np.concatenate([np.tile(interval_low, N), np.tile(motor_low, motors)]),
        np.concatenate([np.tile(-interval_low, N), np.tile(motor_high, motors)]),
    )
