"""A motion as arrays and as named columns, and the joint accelerations that its speeds imply."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from shared.contracts.motions import Trajectory

TIME = "time_s"
QUANTITIES = (
    "joint_position_rad",
    "joint_speed_rad_s",
    "joint_torque_Nm",
    "current_d_A",
    "current_q_A",
    "voltage_d_V",
    "voltage_q_V",
)
"""What a motion says of each joint at each point; the unit is in the name."""


def motion_arrays(motion: Trajectory) -> dict[str, np.ndarray]:
    """`time_s` of shape (points,), and every quantity of shape (points, joints)."""
    return {name: np.array(getattr(motion, name), dtype=float) for name in (TIME, *QUANTITIES)}


def motion_columns(motion: Trajectory) -> dict[str, np.ndarray]:
    """One column (points,) a quantity and joint, such as `joint_position_rad_1`, after `time_s`."""
    arrays = motion_arrays(motion)
    columns = {TIME: arrays.pop(TIME)}
    for name, values in arrays.items():
        columns |= {f"{name}_{joint + 1}": values[:, joint] for joint in range(values.shape[1])}
    return columns


def joint_names(motion: Trajectory, names: Sequence[str] | None = None) -> list[str]:
    """The names given, or joint_1, joint_2, ... where none were.

    Raises
    ------
    ValueError
        There are more or fewer names than joints, or one comes twice.
    """
    joints = len(motion.joint_position_rad[0])
    if names is None:
        return [f"joint_{k + 1}" for k in range(joints)]
    if len(names) != joints:
        raise ValueError(f"joint names: {len(names)} were given, the robot has {joints} joints")
    if len(set(names)) != joints:
        raise ValueError(f"joint names: {', '.join(names)}: one comes twice")
    return list(names)


def joint_columns(motion: Trajectory, names: Sequence[str]) -> dict[str, np.ndarray]:
    """What a controller of the joints follows, joint by joint: `time_s`, then `NAME_position_rad`, `NAME_speed_rad_s`,
    `NAME_acceleration_rad_s2` and `NAME_torque_Nm` of each."""
    quantities = {
        "position_rad": np.array(motion.joint_position_rad),
        "speed_rad_s": np.array(motion.joint_speed_rad_s),
        "acceleration_rad_s2": joint_acceleration(motion),
        "torque_Nm": np.array(motion.joint_torque_Nm),
    }
    columns = {TIME: np.array(motion.time_s)}
    for joint, name in enumerate(names):
        columns |= {f"{name}_{quantity}": values[:, joint] for quantity, values in quantities.items()}
    return columns


def joint_acceleration(motion: Trajectory) -> np.ndarray:
    """Joint accelerations [rad/s2], shape (points, joints): the derivative of the collocation polynomial of the speeds.

    On each interval the speeds are a polynomial through the interval's points; a point that two intervals share has
    the acceleration of the one that it ends, as its voltage has.
    """
    from scipy.interpolate import KroghInterpolator  # a quarter of a second that no other command should wait for

    time, speed = np.array(motion.time_s), np.array(motion.joint_speed_rad_s)
    breaks = np.array(motion.control.breaks_s)
    ends = np.clip(np.searchsorted(time, breaks - 1e-9 * breaks[-1]), 0, len(time) - 1)
    acceleration = np.empty_like(speed)
    for first, last in pairwise(ends):
        inside = slice(first, last + 1)
        own = slice(first + (first > 0), last + 1)
        acceleration[own] = KroghInterpolator(time[inside], speed[inside]).derivative(time[own])
    return acceleration
