"""An arm of other proportions moves as the laws of similarity say it must."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from services.codesign.arm import build_arm
from services.codesign.inverse_dynamics import inverse_dynamics
from services.codesign.motor import MotorParameters
from services.codesign.robot import Robot, preset_wire
from services.codesign.robot_scaling import scaled_arm

NO_MOTOR = MotorParameters(*[0.0] * len(MotorParameters._fields))


def torques(robot: Robot, rates: bool) -> np.ndarray:
    """Of the links alone at some state, at rest unless `rates`."""
    q, qd, qdd = np.random.default_rng(0).normal(size=(3, robot.joints))
    arm = build_arm(robot, [NO_MOTOR] * robot.joints, 0.0, robot.gear_ratio)
    return ca.DM(inverse_dynamics(arm, ca.DM(q), ca.DM(qd * rates), ca.DM(qdd * rates))).full().ravel()


@pytest.mark.parametrize("preset", ["ur5", "puma560", "gen3"])
@pytest.mark.parametrize(("length", "mass"), [(1.0, 1.0), (1.3, 1.0), (1.0, 0.7), (0.8, 1.5)])
def test_torques_follow_mass_and_length(preset: str, length: float, mass: float) -> None:
    """Weight with m s; inertia with m s^2."""
    wire = preset_wire(preset)
    without = {"viscous_friction_Nms_rad": None, "coulomb_friction_Nm": None}
    robot = Robot.from_wire(wire | without)
    scaled = Robot.from_wire(scaled_arm(wire | without, length, [mass] * robot.joints))
    np.testing.assert_allclose(torques(scaled, False), mass * length * torques(robot, False), rtol=1e-9, atol=1e-12)
    floating = [replace(arm, gravity=np.zeros(3)) for arm in (robot, scaled)]
    expected = mass * length**2 * torques(floating[0], True)
    np.testing.assert_allclose(torques(floating[1], True), expected, rtol=1e-9, atol=1e-12)


def test_one_link_alone_and_the_file_is_left_as_it_was() -> None:
    wire = preset_wire("ur5")
    scaled = scaled_arm(wire, 1.0, [1, 1, 2, 1, 1, 1])
    assert (np.array(scaled["link_mass_kg"]) / wire["link_mass_kg"]).tolist() == [1, 1, 2, 1, 1, 1]
    assert wire == preset_wire("ur5")
