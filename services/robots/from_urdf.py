"""From a URDF and settings to the robot format (`services/codesign/robots/*.json`)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from services.codesign.robot import RobotError
from services.robots.urdf_chain import Chain, find_chain
from services.robots.urdf_document import UrdfJoint, quoted_names, read_urdf
from shared.contracts.application import LONGEST_NAME, MOST_JOINTS
from shared.contracts.robots import PerJoint, UrdfRobotRequest

FULL_TURN = 2 * math.pi
"""Range either way [rad] of a continuous joint without a limit of its own: that of the paper's joints 1, 4, 6."""


def robot_from_urdf(request: UrdfRobotRequest) -> dict[str, Any]:
    """The robot's wire form. Space frame: the base link's; home: all joints at zero.

    Raises
    ------
    RobotError
        Naming the setting, or `urdf` with the link or joint, that is wrong.
    """
    document = read_urdf(request.urdf)
    chain = find_chain(document, request.base_link, request.tip_link)
    joints = chain.joints
    if len(joints) > MOST_JOINTS:
        raise RobotError(
            "urdf", f"{len(joints)} joints between {chain.base!r} and {chain.tip!r}: at most {MOST_JOINTS}"
        )
    _check_names("joint_position_limit_rad", request.joint_position_limit_rad, joints)
    _check_names("motor_mounts", request.motor_mounts, joints)
    speeds = [joint.speed for joint in joints]
    viscous, coulomb = [joint.damping for joint in joints], [joint.friction for joint in joints]
    return {
        "name": (request.name or document.name)[:LONGEST_NAME],
        "description": request.description,
        "source": f"URDF {document.name[:LONGEST_NAME]!r}, from {chain.base!r} to {chain.tip!r}",
        "gravity_m_s2": request.gravity_m_s2,
        "screw_axes_space": [_screw_axis(chain, joint) for joint in joints],
        "link_com_home": [_pose(np.eye(3), body.centre) for body in chain.bodies],
        "link_mass_kg": [body.mass for body in chain.bodies],
        "link_inertia_com_kg_m2": [body.inertia.tolist() for body in chain.bodies],
        "motor_position_home_m": [_motor_position(chain, k, request) for k in range(len(joints))],
        "tool_home": _tool(chain, request.payload_position_m),
        "gear_ratio": _per_joint("gear_ratio", request.gear_ratio, joints),
        "joint_position_limit_rad": [_range(joint, request.joint_position_limit_rad) for joint in joints],
        "rotor_speed_limit_rad_s": request.rotor_speed_limit_rad_s,
        "viscous_friction_Nms_rad": _per_joint(
            "viscous_friction_Nms_rad", request.viscous_friction_Nms_rad, joints, viscous
        ),
        "coulomb_friction_Nm": _per_joint("coulomb_friction_Nm", request.coulomb_friction_Nm, joints, coulomb),
        "joint_speed_limit_rad_s": _per_joint(
            "joint_speed_limit_rad_s", request.joint_speed_limit_rad_s, joints, speeds
        ),
    }


def _check_names(field: str, given: Iterable[str], joints: Sequence[UrdfJoint]) -> None:
    names = [joint.name for joint in joints]
    for name in given:
        if name not in names:
            raise RobotError(f"{field}.{name}", f"no joint of the arm; they are {quoted_names(names)}")


def _per_joint(
    field: str, given: PerJoint | None, joints: Sequence[UrdfJoint], default: Sequence[float | None] | None = None
) -> list[float | None]:
    if given is None:
        return list(default or [])
    if isinstance(given, list):
        if len(given) != len(joints):
            raise RobotError(field, f"lists {len(given)} values, the arm has {len(joints)} joints")
        return list(given)
    if not isinstance(given, dict):
        return [given] * len(joints)
    _check_names(field, given, joints)
    values = default or [None] * len(joints)
    found = [given.get(joint.name, value) for joint, value in zip(joints, values, strict=True)]
    if default is None and None in found:
        missing = [joint.name for joint, value in zip(joints, found, strict=True) if value is None]
        raise RobotError(field, f"missing for {quoted_names(missing)}")
    return found


def _range(joint: UrdfJoint, given: Mapping[str, list[float]]) -> list[float]:
    if joint.name in given:
        return given[joint.name]
    if joint.kind == "continuous":
        return [-FULL_TURN, FULL_TURN]
    if joint.lower is None or joint.upper is None or joint.lower >= joint.upper:
        found = "no limit" if joint.lower is None else f"limits {joint.lower:g} to {joint.upper:g} rad"
        raise RobotError(
            "joint_position_limit_rad", f"joint {joint.name!r} has {found} in the URDF: give [lower, upper]"
        )
    return [joint.lower, joint.upper]


def _screw_axis(chain: Chain, joint: UrdfJoint) -> list[float]:
    """(omega, -omega x point) in the space frame."""
    omega = chain.rotations[joint.child] @ joint.axis
    return [*omega.tolist(), *np.cross(chain.positions[joint.child], omega).tolist()]


def _motor_position(chain: Chain, k: int, request: UrdfRobotRequest) -> list[float]:
    joint = chain.joints[k]
    mount = request.motor_mounts.get(joint.name)
    if mount is None:
        at_joint: list[float] = chain.positions[joint.child].tolist()
        return at_joint
    link = joint.parent if mount.link is None else mount.link
    if link not in chain.carriers(k):
        limit = f"{link!r} does not carry joint {joint.name!r}: its motor sits on {quoted_names(chain.carriers(k))}"
        raise RobotError(f"motor_mounts.{joint.name}.link", limit)
    position: list[float] = (chain.positions[link] + chain.rotations[link] @ np.array(mount.xyz_m)).tolist()
    return position


def _tool(chain: Chain, payload: list[float]) -> list[list[float]]:
    R = chain.rotations[chain.tip]
    return _pose(R, chain.positions[chain.tip] + R @ np.array(payload))


def _pose(R: np.ndarray, p: np.ndarray) -> list[list[float]]:
    return [[*row.tolist(), float(x)] for row, x in zip(R, p, strict=True)] + [[0.0, 0.0, 0.0, 1.0]]
