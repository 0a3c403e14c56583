"""Robots as data: the presets, the geometry read from them, and refusals that name the field."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest

from services.codesign.robot import Robot, RobotError, preset_names, preset_wire


def test_presets():
    joints = {"gen3": 7, "puma560": 6, "ur5": 6, "ur5_modern_robotics": 6}
    assert preset_names() == list(joints)
    for name in preset_names():
        robot = Robot.preset(name)
        assert (robot.name, robot.joints) == (name, joints[name])


def test_preset_limits_are_the_papers():
    """Eq. (5): joint ranges, and the rotor speed limit behind the gears."""
    robot = Robot.preset("ur5")
    assert robot.joint_upper == pytest.approx(np.pi * np.array([2, 0.6, 0.6, 2, 0.6, 2]))
    assert robot.joint_lower == pytest.approx(-robot.joint_upper)
    assert robot.rotor_speed_limit == pytest.approx(100 * np.pi)
    assert robot.joint_speed_limit * robot.gear_ratio == pytest.approx(np.full(6, 100 * np.pi))


def test_corrected_wrist_is_the_cylinder_it_should_be():
    """Links 4 to 6: mass (3 r^2 + h^2) / 12 and mass r^2 / 2 hold with r = 0.06 m, and with 0.6 m in the data set."""
    for name, radius in (("ur5", 0.06), ("ur5_modern_robotics", 0.6)):
        robot = Robot.preset(name)
        axial = np.array([inertia[2, 2] for inertia in robot.link_inertia[3:]])
        # 2 percent: the published figures are rounded.
        assert axial == pytest.approx(robot.link_mass[3:] * radius**2 / 2, rel=0.02)


def test_joint_origins_lie_on_their_axes():
    robot = Robot.preset("ur5")
    for S, point in zip(robot.screw_axes, robot.joint_origins, strict=True):
        assert np.cross(point, S[:3]) == pytest.approx(S[3:], abs=1e-15)


def test_reversing_gears_have_positive_speed_limits():
    wire = preset_wire("ur5")
    wire["gear_ratio"] = [-62.6, 107.8, -53.7, 76.0, 71.9, 76.7]
    robot = Robot.from_wire(wire)
    assert (robot.joint_speed_limit > 0).all()
    assert robot.joint_speed_limit[0] == pytest.approx(100 * math.pi / 62.6)


def test_arrays_cannot_be_written_to():
    with pytest.raises(ValueError, match="read-only"):
        Robot.preset("ur5").link_mass[0] = 1.0


def scaled(wire, field, factor):
    wire[field] = (np.array(wire[field]) * factor).tolist()


def tilted(wire):
    wire["screw_axes_space"][2][:3] = [0.0, 1.0, 0.1]


def helical(wire):
    wire["screw_axes_space"][0][3:] = [0.0, 0.0, 0.1]


def sheared(wire):
    wire["link_com_home"][1][0][0] = 0.5


def mirrored(wire):
    for row in wire["tool_home"][:3]:
        row[0] = -row[0]


def lopsided(wire):
    wire["link_inertia_com_kg_m2"][2][0][1] = 0.01


@pytest.mark.parametrize(
    ("field", "spoil"),
    [
        ("link_mass_kg", lambda wire: wire.pop("link_mass_kg")),
        ("link_mass_kg", lambda wire: wire["link_mass_kg"].pop()),
        ("link_mass_kg", lambda wire: scaled(wire, "link_mass_kg", -1)),
        ("link_mass_kg", lambda wire: wire.update(link_mass_kg=["heavy"] * 6)),
        ("link_inertia_com_kg_m2", lambda wire: wire["link_inertia_com_kg_m2"][0].pop()),
        ("link_inertia_com_kg_m2", lambda wire: scaled(wire, "link_inertia_com_kg_m2", -1)),
        ("link_inertia_com_kg_m2", lopsided),
        ("gravity_m_s2", lambda wire: wire.update(gravity_m_s2=-9.81)),
        ("gravity_m_s2", lambda wire: wire.update(gravity_m_s2=[0, 0, math.nan])),
        ("screw_axes_space", tilted),
        ("screw_axes_space", helical),
        ("link_com_home", sheared),
        ("tool_home", mirrored),
        ("motor_position_home_m", lambda wire: wire.update(motor_position_home_m=None)),
        ("gear_ratio", lambda wire: wire.update(gear_ratio=[100, 100, 0, 100, 100, 100])),
        ("gear_ratio", lambda wire: wire.update(gear_ratio=[])),
        ("joint_position_limit_rad", lambda wire: wire.update(joint_position_limit_rad=[[1, -1]] * 6)),
        ("joint_position_limit_rad", lambda wire: wire.update(joint_position_limit_rad=[1] * 6)),
        ("joint_position_limit_rad", lambda wire: wire["joint_position_limit_rad"].pop()),
        ("rotor_speed_limit_rad_s", lambda wire: wire.update(rotor_speed_limit_rad_s=0)),
        ("rotor_speed_limit_rad_s", lambda wire: wire.update(rotor_speed_limit_rad_s=[1, 2])),
        ("friction", lambda wire: wire.update(friction=[0.1] * 6)),
    ],
)
def test_refusals_name_the_field(field, spoil):
    wire = copy.deepcopy(preset_wire("ur5"))
    spoil(wire)
    with pytest.raises(RobotError) as refusal:
        Robot.from_wire(wire)
    assert refusal.value.field == field
    assert str(refusal.value).startswith(f"{field}: ")


def test_unknown_preset_is_refused():
    with pytest.raises(RobotError, match="unknown robot 'ur6'; presets: gen3, puma560, ur5, ur5_modern_robotics"):
        Robot.preset("ur6")
