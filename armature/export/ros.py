"""A motion as ROS's `trajectory_msgs/JointTrajectory`, the message that joint trajectory controllers take.

https://github.com/ros2/common_interfaces/blob/rolling/trajectory_msgs/msg/JointTrajectory.msg: a header, the joints'
names, and points with positions [rad], velocities [rad/s], accelerations [rad/s2], effort [N m] and the time from the
start.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from armature.export.motion_columns import joint_acceleration
from shared.contracts.motions import Trajectory

NANOSECONDS = 1_000_000_000


def joint_trajectory(motion: Trajectory, names: Sequence[str]) -> dict[str, Any]:
    """The message as plain data, for JSON and YAML.

    Parameters
    ----------
    names
        Of the joints, as the robot's controller knows them, in their order.
    """
    rows = zip(
        motion.time_s,
        motion.joint_position_rad,
        motion.joint_speed_rad_s,
        joint_acceleration(motion).tolist(),
        motion.joint_torque_Nm,
        strict=True,
    )
    return {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": list(names),
        "points": [
            {
                "positions": position,
                "velocities": speed,
                "accelerations": acceleration,
                "effort": torque,
                "time_from_start": duration(time),
            }
            for time, position, speed, acceleration, torque in rows
        ],
    }


def duration(seconds: float) -> dict[str, int]:
    """`builtin_interfaces/Duration`, to the nanosecond."""
    sec, nanosec = divmod(round(seconds * NANOSECONDS), NANOSECONDS)
    return {"sec": sec, "nanosec": nanosec}
