"""A URDF's arm: its dynamics are those that Pinocchio reads from the same file."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from services.codesign.arm import build_arm
from services.codesign.inverse_dynamics import inverse_dynamics
from services.codesign.motor import MotorParameters
from services.codesign.robot import Robot, RobotError
from services.robots.from_urdf import robot_from_urdf
from services.robots.urdf_chain import find_chain
from services.robots.urdf_document import read_urdf
from shared.contracts.robots import UrdfRobotRequest
from tests.numerics.urdfs import joint, link, random_urdf, robot

MY_ARM = (Path(__file__).parents[2] / "examples" / "my_arm.urdf").read_text()

AGREEMENT = 1e-9
"""Two programs from one file of numbers: only rounding may differ."""


def arm_of(urdf: str, **settings) -> Robot:
    request = UrdfRobotRequest.model_validate({"urdf": urdf, "gear_ratio": 100.0, **settings})
    return Robot.from_wire(robot_from_urdf(request))


def torques(arm: Robot, q, qd, qdd) -> np.ndarray:
    """Inverse dynamics with motors that weigh nothing."""
    nothing = [MotorParameters(*[0.0] * len(MotorParameters._fields)) for _ in range(arm.joints)]
    x = [ca.SX.sym(name, arm.joints) for name in ("q", "qd", "qdd")]
    tau = inverse_dynamics(build_arm(arm, nothing, 0.0, arm.gear_ratio), *x)
    return ca.Function("tau", x, [tau])(q, qd, qdd).full().ravel()


def assert_equals_pinocchio(urdf: str, arm: Robot, joints: list[str], seed: int) -> None:
    model = pin.buildModelFromXML(urdf)
    index = [model.joints[model.getJointId(name)].idx_v for name in joints]
    rng = np.random.default_rng(seed)
    for _ in range(10):
        q, qd, qdd = rng.uniform(-2.5, 2.5, arm.joints), *rng.normal(size=(2, arm.joints)) * 5
        full = np.zeros((3, model.nv))
        full[:, index] = q, qd, qdd
        expected = pin.rnea(model, model.createData(), *full)[index]
        assert torques(arm, q, qd, qdd) == pytest.approx(expected, rel=AGREEMENT, abs=AGREEMENT)


@pytest.mark.parametrize("joints", [1, 2, 3, 6, 7])
@pytest.mark.parametrize("seed", range(2))
def test_inverse_dynamics_equals_pinocchio_on_the_same_file(joints, seed):
    urdf = random_urdf(joints, seed)
    names = [f"joint{k + 1}" for k in range(joints)]
    assert_equals_pinocchio(urdf, arm_of(urdf, tip_link="flange"), names, seed)


def test_the_example_equals_pinocchio():
    arm = arm_of(MY_ARM, viscous_friction_Nms_rad=0.0, coulomb_friction_Nm=0.0)
    fixed = MY_ARM.replace('"continuous"', '"revolute"')  # Pinocchio gives a continuous joint two coordinates
    assert_equals_pinocchio(fixed, arm, ["yaw", "pitch", "elbow"], 3)


def test_fingers_off_the_chain_are_held_at_zero():
    rng = np.random.default_rng(5)
    fingers = [link("left", rng), link("right", rng)]
    fingers += [joint("open", "prismatic", "flange", "left", rng)]
    fingers += [joint("close", "continuous", "flange", "right", rng, '<mimic joint="open"/>')]
    arm_alone = random_urdf(3, 9)
    urdf = arm_alone.replace("</robot>", "".join(fingers) + "</robot>")
    chain = find_chain(read_urdf(urdf), tip_link="flange")
    assert set(chain.held) == {"open", "close"}
    # At zero a joint's kind makes no difference; Pinocchio's neutral state is zero for fixed ones.
    held = urdf.replace('type="prismatic"', 'type="fixed"').replace('type="continuous"', 'type="fixed"')
    names = ["joint1", "joint2", "joint3"]
    assert_equals_pinocchio(held, arm_of(urdf, tip_link="flange"), names, 9)


def test_limits_friction_and_mounts():
    arm = arm_of(MY_ARM, motor_mounts={"elbow": {"link": "upper_arm", "xyz_m": [0.05, 0, 0.01]}})
    assert arm.joint_upper == pytest.approx([2 * np.pi, 2.0, 2.5])
    assert arm.joint_speed_limit == pytest.approx([3, 3, 3])  # the URDF's, below the rotor's pi
    assert arm.viscous_friction == pytest.approx([0.5, 0.5, 0.3])
    assert arm.coulomb_friction == pytest.approx([1.0, 1.0, 0.5])
    # By hand: pitch stands 0.2 m high, so does the upper arm; the forearm and the flange weigh 1.8 kg together.
    assert arm.motor_position[2] == pytest.approx([0.05, 0, 0.21])
    assert arm.link_mass == pytest.approx([2, 3, 1.8])
    assert arm.link_com_home[2][:3, 3] == pytest.approx([0.3 + (1.5 * 0.12 + 0.3 * 0.25) / 1.8, 0, 0.2])
    # Steiner: about y, 0.0078 + 0.0002 and the reduced mass times the distance squared.
    reduced = 1.5 * 0.3 / 1.8 * 0.13**2
    assert arm.link_inertia[2][1, 1] == pytest.approx(0.0078 + 0.0002 + reduced)
    assert arm.tool_home[:3, 3] == pytest.approx([0.55, 0, 0.2])


def test_settings_by_name_and_in_order():
    assert arm_of(MY_ARM, gear_ratio={"yaw": 50, "pitch": -60, "elbow": 70}).gear_ratio.tolist() == [50, -60, 70]
    arm = arm_of(MY_ARM, gear_ratio=[1, 2, 3], joint_speed_limit_rad_s={"elbow": 1.0}, payload_position_m=[0.1, 0, 0])
    assert arm.joint_speed_bound.tolist() == [3, 3, 1]
    assert arm.tool_home[:3, 3] == pytest.approx([0.65, 0, 0.2])


RNG = np.random.default_rng(0)
A, B, C = (link(name, RNG) for name in "ABC")

REFUSED = {
    "prismatic": (robot(A, B, joint("slide", "prismatic", "A", "B", RNG)), {}, "urdf", "'slide' is prismatic"),
    "floating": (robot(A, B, joint("free", "floating", "A", "B", RNG)), {}, "urdf", "'free' is floating"),
    "planar": (robot(A, B, joint("flat", "planar", "A", "B", RNG)), {}, "urdf", "'flat' is planar"),
    "mimic": (
        robot(A, B, joint("ape", "revolute", "A", "B", RNG, '<mimic joint="x"/>')),
        {},
        "urdf",
        "'ape' mimics 'x'",
    ),
    "two tips": (
        robot(A, B, C, joint("l", "revolute", "A", "B", RNG), joint("r", "revolute", "A", "C", RNG)),
        {},
        "tip_link",
        "'B', 'C'",
    ),
    "two bases": (robot(A, B, C, joint("j", "revolute", "A", "B", RNG)), {}, "base_link", "'A', 'C'"),
    "nothing turns": (robot(A, B, joint("j", "fixed", "A", "B", RNG)), {}, "tip_link", "no joint turns"),
    "ring": (
        robot(A, B, joint("j", "revolute", "A", "B", RNG), joint("k", "revolute", "B", "A", RNG)),
        {"base_link": "A"},
        "urdf",
        "ring",
    ),
    "two parents": (
        robot(A, B, C, joint("j", "fixed", "A", "C", RNG), joint("k", "fixed", "B", "C", RNG)),
        {},
        "urdf",
        "two parents",
    ),
    "no such link": (robot(A, joint("j", "revolute", "A", "Z", RNG)), {}, "urdf", "no link 'Z'"),
    "no such tip": (MY_ARM, {"tip_link": "hand"}, "tip_link", "no link 'hand'"),
    "no limit": (MY_ARM.replace('lower="-2.0" upper="2.0"', ""), {}, "joint_position_limit_rad", "'pitch'"),
    "axis of no direction": (MY_ARM.replace('xyz="0 0 1"', 'xyz="0 0 0"'), {}, "urdf", "'yaw': its axis"),
    "negative mass": (MY_ARM.replace('mass value="3.0"', 'mass value="-3.0"'), {}, "urdf", "'upper_arm': mass -3"),
    "negative moment": (MY_ARM.replace('ixx="0.0042"', 'ixx="-0.0042"'), {}, "urdf", "'shoulder': inertia"),
    "NaN": (MY_ARM.replace('mass value="3.0"', 'mass value="nan"'), {}, "urdf", "'upper_arm': mass"),
    "huge": (MY_ARM.replace('xyz="0.30 0 0"', 'xyz="1e308 0 0"'), {}, "urdf", "'elbow': xyz"),
    "words": (MY_ARM.replace('xyz="0.30 0 0"', 'xyz="a b c"'), {}, "urdf", "could not convert"),
    "two numbers": (MY_ARM.replace('xyz="0.30 0 0"', 'xyz="1 2"'), {}, "urdf", ""),
    "gear of no joint": (MY_ARM, {"gear_ratio": {"wrist": 3.0}}, "gear_ratio.wrist", "no joint"),
    "gear missing": (MY_ARM, {"gear_ratio": {"yaw": 3.0}}, "gear_ratio", "missing for 'pitch', 'elbow'"),
    "gears too few": (MY_ARM, {"gear_ratio": [3.0]}, "gear_ratio", "3 joints"),
    "motor on another body": (
        MY_ARM,
        {"motor_mounts": {"elbow": {"link": "base"}}},
        "motor_mounts.elbow.link",
        "'upper_arm'",
    ),
    "a file's name": ("my_arm.urdf", {}, "urdf", "text"),
    "not XML": ("<robot", {}, "urdf", "not XML"),
    "another root": ("<html/>", {}, "urdf", "'html'"),
    "entities": (
        '<!DOCTYPE r [<!ENTITY a "x"><!ENTITY b "&a;&a;">]><robot name="r">&b;</robot>',
        {},
        "urdf",
        "no document type",
    ),
    "external entity": (
        '<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/hostname">]><robot name="r">&a;</robot>',
        {},
        "urdf",
        "no document type",
    ),
    "too long": ("<robot>" + " " * 1_000_000 + "</robot>", {}, "urdf", "at most"),
}


@pytest.mark.parametrize("case", REFUSED, ids=str)
def test_refusals_name_the_part(case):
    urdf, settings, field, reason = REFUSED[case]
    with pytest.raises(RobotError) as refusal:
        arm_of(urdf, **settings)
    assert refusal.value.field == field
    assert reason in refusal.value.reason


def test_meshes_and_unknown_elements_are_not_looked_at():
    more = '<link name="eye"><visual><geometry><mesh filename="file:///dev/zero"/></geometry></visual></link>'
    more += '<gazebo><plugin filename="x.so"/></gazebo>' + joint("look", "fixed", "flange", "eye", RNG)
    assert arm_of(MY_ARM.replace("</robot>", more + "</robot>")).joints == 3
