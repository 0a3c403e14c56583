"""Optima that are known in closed form, found by the whole chain from problem to solution."""

from __future__ import annotations

import math

import numpy as np
import pytest

from services.codesign.motor import evaluate_motor
from services.codesign.motor_data import MotorData
from services.codesign.problem import Objective, Problem, Task, Transcription
from services.codesign.robot import Robot
from services.codesign.solve import solve
from tests.numerics.arms import pose

DESIGN = np.array([60, 14, 36, 3, 5.5, 6, 2]) * 1e-3
MASS, LENGTH, GEAR, STROKE = 2.0, 0.3, 30.0, 0.8

SOLVED = 2e-4
"""Relative: an interior point stops about 1e-7 s short for each of the 60 to 120 bounds that are active."""


def turntable(rotor_speed_limit: float) -> Robot:
    """A point mass on a rod about the vertical: gravity does nothing."""
    return Robot(
        name="turntable",
        gravity=np.array([0, 0, -9.81]),
        screw_axes=np.array([[0.0, 0, 1, 0, 0, 0]]),
        link_com_home=pose(np.eye(3), np.array([LENGTH, 0, 0]))[None],
        link_mass=np.array([MASS]),
        link_inertia=np.zeros((1, 3, 3)),
        motor_position=np.zeros((1, 3)),
        tool_home=np.eye(4),
        gear_ratio=np.array([GEAR]),
        joint_lower=np.array([-3.0]),
        joint_upper=np.array([3.0]),
        rotor_speed_limit=rotor_speed_limit,
    )


def largest_acceleration(data: MotorData) -> float:
    motor, _ = evaluate_motor(DESIGN, data)
    inertia = MASS * LENGTH**2 + motor.rotor_inertia_axial * GEAR**2
    return GEAR * 1.5 * data.pole_pairs * motor.flux_linkage * data.current_limit / inertia


@pytest.mark.parametrize("rotor_speed_limit", [1e4, 314.0], ids=["bang-bang", "with a cruise"])
def test_minimum_time_of_one_joint(rotor_speed_limit):
    """Current limit a, speed limit v: 2 sqrt(s / a), or s / v + v / a when the speed is reached on the way.

    The voltage limit is out of the way. With one Radau point an interval and the corners at interval ends the
    discrete optimum equals the continuous one; a cruise has its corners inside, and 60 intervals leave 0.2 percent.
    """
    data = MotorData(voltage_limit=1e4)
    task = Task(np.array([-STROKE / 2]), np.array([STROKE / 2]))
    solution = solve(
        Problem(
            turntable(rotor_speed_limit),
            task,
            data,
            transcription=Transcription("radau", 1, 60),
            design=DESIGN[None],
        )
    )
    a, v = largest_acceleration(data), rotor_speed_limit / GEAR
    bang_bang = math.sqrt(STROKE * a) <= v
    expected = 2 * math.sqrt(STROKE / a) if bang_bang else STROKE / v + v / a
    assert bang_bang == (rotor_speed_limit == 1e4)
    assert solution.success
    assert solution.objective == pytest.approx(expected, rel=SOLVED if bang_bang else 2e-3)


def test_minimum_effort_of_one_joint():
    """Long motions run at constant speed, their field weakened as far as it pays.

    At constant speed w = P Z s / T (electrical) no torque is needed: u_d = R i_d and u_q = w (Phi_m + L i_d). The
    least u'u over i_d is (w Phi_m)^2 R^2 / (R^2 + w^2 L^2).
    """
    data = MotorData(voltage_limit=1e3, current_limit=5.0)
    motor, _ = evaluate_motor(DESIGN, data)
    T, stroke = 4.0, 1.0  # 800 electrical time constants; weakening saves 2.5 percent
    task = Task(np.array([-stroke / 2]), np.array([stroke / 2]), duration=T)
    solution = solve(
        Problem(
            turntable(1e4),
            task,
            data,
            objective=Objective("energy"),
            transcription=Transcription("legendre", 2, 400),
            design=DESIGN[None],
        )
    )
    R, L = motor.phase_resistance, motor.inductance
    w = data.pole_pairs * GEAR * stroke / T
    expected = T * (w * motor.flux_linkage) ** 2 * R**2 / (R**2 + (w * L) ** 2)
    assert solution.success
    # 1 percent: the ends, where the arm starts and stops; an interval in which the voltage is held is 0.25 percent.
    assert solution.objective == pytest.approx(expected, rel=1e-2)
    i_d = solution.motion.current_d[len(solution.motion.time) // 2, 0]
    assert i_d == pytest.approx(-(w**2) * L * motor.flux_linkage / (R**2 + (w * L) ** 2), rel=1e-2)
