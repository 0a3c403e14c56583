"""Presets against what is published of them, and what `check_robot` finds in each."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from services.codesign.arm import build_arm
from services.codesign.inverse_dynamics import inverse_dynamics
from services.codesign.motor import MotorParameters
from services.codesign.robot import Robot, preset_wire
from services.robots.check import check_robot, gyration_radii, reach

PRINTED = 6e-5
"""Half of the last digit of torques that are published with four decimals."""


def holding_torques(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Against gravity, with motors that weigh nothing."""
    nothing = [MotorParameters(*[0.0] * len(MotorParameters._fields)) for _ in range(robot.joints)]
    x = [ca.SX.sym(name, robot.joints) for name in ("q", "qd", "qdd")]
    tau = inverse_dynamics(build_arm(robot, nothing, 0.0, robot.gear_ratio), *x)
    still = np.zeros(robot.joints)
    return ca.Function("tau", x, [tau])(q, still, still).full().ravel()


def test_puma_holds_the_published_gravity_load():
    """Corke's Robotics Toolbox prints this for the nominal pose, from the same parameters by its own recursion."""
    nominal = np.array([0, np.pi / 4, np.pi, 0, np.pi / 4, 0])
    published = [0, 31.6399, 6.0351, 0, 0.0283, 0]
    assert holding_torques(Robot.preset("puma560"), nominal) == pytest.approx(published, abs=PRINTED)


def test_puma_stands_where_its_table_says():
    """By hand from the Denavit-Hartenberg table at zero: a2 + a3, -d3, d4."""
    assert Robot.preset("puma560").tool_home[:3, 3] == pytest.approx([0.4318 + 0.0203, -0.15005, 0.4318])


def test_puma_friction_is_that_of_the_motors_behind_the_gears():
    puma = Robot.preset("puma560")
    viscous = np.array([1.48e-3, 0.817e-3, 1.38e-3, 71.2e-6, 82.6e-6, 36.7e-6])
    assert puma.viscous_friction == pytest.approx(viscous * puma.gear_ratio**2)
    assert puma.coulomb_friction[0] == pytest.approx((0.395 + 0.435) / 2 * 62.6111)


def test_gen3_reaches_and_weighs_what_its_links_do():
    """Its maker gives 902 mm of reach from the shoulder (joint 2) to the tool."""
    gen3 = Robot.preset("gen3")
    assert gen3.link_mass.sum() == pytest.approx(6.4915)
    shoulder_to_tool = gen3.tool_home[2, 3] - gen3.motor_position[1, 2]
    assert shoulder_to_tool == pytest.approx(0.902, abs=1e-3)
    assert reach(gen3) > shoulder_to_tool


def test_the_slip_in_the_ur5_data_is_found_and_nothing_else():
    """MODEL section 3: inertias of a radius of 0.6 m where 0.06 m is meant, in links 4 to 6."""
    found = check_robot(Robot.preset("ur5_modern_robotics"))
    assert [finding.where for finding in found] == ["link 4", "link 5", "link 6"]
    assert all("gyration radius" in finding.what and finding.value == "0.424 m" for finding in found)
    assert gyration_radii(Robot.preset("ur5_modern_robotics"))[5] == pytest.approx(0.6 / np.sqrt(2), rel=0.01)
    assert check_robot(Robot.preset("ur5")) == []
    assert check_robot(Robot.preset("gen3")) == []


def test_placeholders_in_the_puma_data_are_found():
    found = {(finding.where, finding.what) for finding in check_robot(Robot.preset("puma560"))}
    assert ("link 1", "has no mass") in found
    assert ("link 3", "no body has such principal moments") in found


def spoilt(**changes) -> Robot:
    return Robot.from_wire(preset_wire("ur5") | changes)


def centres_in_millimetres() -> list:
    poses = np.array(preset_wire("ur5")["link_com_home"])
    poses[:, :3, 3] *= 1000
    return poses.tolist()


@pytest.mark.parametrize(
    ("changes", "where", "what"),
    [
        ({"link_mass_kg": [3.7, 0.0, 2.275, 1.219, 1.219, 0.1879]}, "link 2", "no mass"),
        ({"link_mass_kg": [3700.0, 8.393, 2.275, 1.219, 1.219, 0.1879]}, "link 1", "grams"),
        ({"link_inertia_com_kg_m2": [np.diag([1.0, 1, 0]).tolist()] * 6}, "link 1", "not positive definite"),
        ({"link_inertia_com_kg_m2": [np.diag([1e-3, 1e-3, 3e-3]).tolist()] * 6}, "link 6", "principal moments"),
        ({"gear_ratio": [1.0, *[100.0] * 5]}, "joint 1", "almost no gear"),
        ({"gear_ratio": [*[100.0] * 5, -9000.0]}, "joint 6", "large gear"),
        ({"joint_position_limit_rad": [[-360.0, 360.0]] * 6}, "joint 3", "degrees"),
        (
            {"motor_position_home_m": (1000 * np.array(preset_wire("ur5")["motor_position_home_m"])).tolist()},
            "arm",
            "millimetres",
        ),
        ({"link_com_home": centres_in_millimetres()}, "link 2", "centre of mass"),
        ({"gravity_m_s2": [0, 0, -9810.0]}, "arm", "gravity"),
    ],
)
def test_each_kind_of_slip_is_found(changes, where, what):
    found = check_robot(spoilt(**changes))
    assert any(finding.where == where and what in finding.what for finding in found), found
