"""A motion as arrays and as named columns, and the joint accelerations that its speeds imply."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.interpolate import KroghInterpolator

from shared.contracts.results import Trajectory

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


def joint_acceleration(motion: Trajectory) -> np.ndarray:
    """Joint accelerations [rad/s2], shape (points, joints): the derivative of the collocation polynomial of the speeds.

    On each interval the speeds are a polynomial through the interval's points; a point that two intervals share has
    the acceleration of the one that it ends, as its voltage has.
    """
    time, speed = np.array(motion.time_s), np.array(motion.joint_speed_rad_s)
    breaks = np.array(motion.control.breaks_s)
    ends = np.clip(np.searchsorted(time, breaks - 1e-9 * breaks[-1]), 0, len(time) - 1)
    acceleration = np.empty_like(speed)
    for first, last in pairwise(ends):
        inside = slice(first, last + 1)
        own = slice(first + (first > 0), last + 1)
        acceleration[own] = KroghInterpolator(time[inside], speed[inside]).derivative(time[own])
    return acceleration
