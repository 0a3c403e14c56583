"""The limits of a motion, found from the wire answers: a result states its peaks at the points as shares."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from services.codesign.robot import Robot
from shared.contracts.motions import MotionResult, Trajectory

SERIES = {
    "rotor_speed": "joint_speed_rad_s",
    "joint_torque": "joint_torque_Nm",
    "current_d": "current_d_A",
    "current_q": "current_q_A",
    "voltage_d": "voltage_d_V",
    "voltage_q": "voltage_q_V",
}
"""Names of the peaks in a result, and of the same quantities in a trajectory."""


@dataclass(frozen=True)
class MotionLimits:
    """Largest allowed magnitudes, each of shape (n,), NaN where unknown; and the joints' ranges."""

    joint_speed: npt.NDArray[np.float64]  # rad/s, the rotor's limit at the joint
    joint_torque: npt.NDArray[np.float64]  # N m, Z 3/2 P Phi_m i_max
    current: npt.NDArray[np.float64]  # A
    voltage: npt.NDArray[np.float64]  # V
    joint_lower: npt.NDArray[np.float64]  # rad
    joint_upper: npt.NDArray[np.float64]  # rad


def motion_limits(motion: Trajectory, result: MotionResult, robot: Robot | None) -> MotionLimits:
    """Limit = largest magnitude / its share of the limit, joint by joint.

    Parameters
    ----------
    motion
        The motion on its grid.
    result
        Of the same task and method.
    robot
        For the joints' ranges; unknown when None.
    """
    shares = result.peaks if result.peaks_at_points is None else result.peaks_at_points
    found = {name: _limit(np.array(getattr(motion, series)), shares, name) for name, series in SERIES.items()}
    unknown = np.full(found["rotor_speed"].shape, np.nan)
    return MotionLimits(
        joint_speed=found["rotor_speed"],
        joint_torque=found["joint_torque"],
        current=np.fmax(found["current_d"], found["current_q"]),
        voltage=np.fmax(found["voltage_d"], found["voltage_q"]),
        joint_lower=unknown if robot is None else robot.joint_lower,
        joint_upper=unknown if robot is None else robot.joint_upper,
    )


def _limit(values: npt.NDArray[np.float64], peaks: Mapping[str, list[float]], name: str) -> npt.NDArray[np.float64]:
    """Shape (n,); NaN for a joint that stands still, whose share of the limit is 0."""
    largest = np.abs(values).max(axis=0)
    share = np.array(peaks[name])
    limit = np.full(largest.shape, np.nan)
    np.divide(largest, share, out=limit, where=share > 0)
    return limit
