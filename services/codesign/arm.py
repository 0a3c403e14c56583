"""The arm as a chain of bodies: links, stators, rotors and the payload  (Section II-B; MODEL section 3).

Frames: link frame {k} lies at home at `Robot.joint_origins[k]` with the axes of the space frame, and moves with
link k. Joint axes and motor positions are therefore constants in every frame, with many exact zeros.

Motor k sits on link k-1 (motor 1 on the base). Its stator belongs to that link. Its rotor is a body of revolution
turning about the joint axis at Z times the joint rate *relative to that link*.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from services.codesign.motor import MotorParameters
from services.codesign.robot import PAYLOAD_RADIUS, Robot
from services.codesign.spatial import cylinder_inertia, rotation, spatial_inertia

Expression = Any


@dataclass(frozen=True)
class Arm:
    """Inertias of one arm with one set of motors, ready for the dynamics algorithms.

    Lists are indexed by joint 0..n-1. `link_inertia[k]` holds link k, the stator of motor k+1 and, on the last
    link, the payload. `rotor_inertia[k]` is rotor k in the frame of the link that carries it (k-1, or the base).
    """

    axes: np.ndarray  # (n, 3) joint axes, in the link frame and in its parent's alike
    offsets: np.ndarray  # (n, 3) origin of frame k in frame k-1 [m]
    gravity: np.ndarray  # (3,) m/s2
    gear_ratio: Expression  # (n,)
    link_inertia: list[Expression]  # 6 x 6
    rotor_inertia: list[Expression]  # 6 x 6
    rotor_inertia_axial: list[Expression]  # [kg m2]
    motor_positions: np.ndarray  # (n, 3) motor k in the frame of the link that carries it [m]
    viscous_friction: np.ndarray  # (n,) N m s/rad, at the joint
    coulomb_friction: np.ndarray  # (n,) N m, at the joint

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return len(self.axes)

    def pose(self, k: int, q: Expression) -> tuple[Expression, np.ndarray]:
        """Pose (R, p) of frame k in frame k-1 at joint angle q[k]."""
        return rotation(self.axes[k], q[k]), self.offsets[k]

    def joint_screw(self, k: int) -> Expression:
        """A_k: the joint's screw axis in its own link frame, shape (6,)."""
        return ca.vertcat(ca.sparsify(ca.DM(self.axes[k])), ca.DM(3, 1))

    def rotor_screw(self, k: int) -> Expression:
        """Screw axis of rotor k in the frame of the link that carries it: along the joint axis, through the motor."""
        axis, position = self.axes[k], self.motor_positions[k]
        return ca.sparsify(ca.DM(np.concatenate([axis, -np.cross(axis, position)])))


def build_arm(robot: Robot, motors: list[MotorParameters], payload: Expression, gear_ratio: Expression) -> Arm:
    """Assemble the bodies.

    Parameters
    ----------
    robot
        Geometry and link masses.
    motors
        One entry a joint (numbers or symbols).
    payload
        Mass [kg] of the solid ball centred at the tool frame.
    gear_ratio
        Shape (n,); passed apart from the robot so that it can be a parameter or a variable.
    """
    n, origins = robot.joints, robot.joint_origins
    parents = np.vstack([np.zeros(3), origins[:-1]])
    links: list[Expression] = []
    for k in range(n):
        inertia = _link_inertia(robot, k, origins[k])
        if k + 1 < n:
            position = robot.motor_position[k + 1] - origins[k]
            inertia = inertia + _stator_inertia(motors[k + 1], position, robot.joint_axes[k + 1])
        else:
            inertia = inertia + _payload_inertia(payload, robot.tool_home[:3, 3] - origins[k])
        links.append(inertia)
    return Arm(
        axes=robot.joint_axes,
        offsets=origins - parents,
        gravity=robot.gravity,
        gear_ratio=gear_ratio,
        link_inertia=links,
        rotor_inertia=[
            _rotor_inertia(motors[k], robot.motor_position[k] - parents[k], robot.joint_axes[k]) for k in range(n)
        ],
        rotor_inertia_axial=[motors[k].rotor_inertia_axial for k in range(n)],
        motor_positions=robot.motor_position - parents,
        viscous_friction=robot.viscous_friction,
        coulomb_friction=robot.coulomb_friction,
    )


def _link_inertia(robot: Robot, k: int, origin: np.ndarray) -> Expression:
    pose = robot.link_com_home[k]
    R = pose[:3, :3]
    return spatial_inertia(
        robot.link_mass[k], pose[:3, 3] - origin, ca.sparsify(ca.DM(R @ robot.link_inertia[k] @ R.T))
    )


def _stator_inertia(motor: MotorParameters, position: np.ndarray, axis: np.ndarray) -> Expression:
    about_centre = cylinder_inertia(motor.stator_inertia_axial, motor.stator_inertia_transverse, axis)
    return spatial_inertia(motor.stator_mass, position, about_centre)


def _rotor_inertia(motor: MotorParameters, position: np.ndarray, axis: np.ndarray) -> Expression:
    about_centre = cylinder_inertia(motor.rotor_inertia_axial, motor.rotor_inertia_transverse, axis)
    return spatial_inertia(motor.rotor_mass, position, about_centre)


def _payload_inertia(mass: Expression, position: np.ndarray) -> Expression:
    return spatial_inertia(mass, position, 0.4 * mass * PAYLOAD_RADIUS**2 * ca.DM.eye(3))
