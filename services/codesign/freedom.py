"""Which of a design's numbers may be chosen beyond the paper: gear ratios, and motors that several joints share."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from services.codesign.robot import Robot


class FreedomError(ValueError):
    """A freedom that an arm does not have; `field` says where in a request, `value` and `limit` why."""

    def __init__(self, field: str, value: object, limit: str) -> None:
        super().__init__(f"{field} = {value}: {limit}")
        self.field = field
        self.value = value
        self.limit = limit


@dataclass(frozen=True)
class FreeGear:
    """A gear ratio that is a variable of the design; which way the gear turns stays the robot's."""

    joint: int  # 0..n-1
    low: float  # of |Z|
    high: float


@dataclass(frozen=True)
class Freedom:
    """What a design may choose, and what it must not: joints of one group have motors of the same dimensions."""

    gears: tuple[FreeGear, ...] = ()  # by joint, in rising order
    identical: tuple[tuple[int, ...], ...] = ()  # groups of joints 0..n-1

    @property
    def free_gears(self) -> tuple[int, ...]:
        """Joints whose gear ratio is free."""
        return tuple(gear.joint for gear in self.gears)

    def motor_of(self, joints: int) -> tuple[int, ...]:
        """The motor, 0..m-1, that each joint has: a joint that shares it with an earlier one adds none."""
        first = {joint: min(group) for group in self.identical for joint in group}
        leaders = [joint for joint in range(joints) if first.get(joint, joint) == joint]
        return tuple(leaders.index(first.get(joint, joint)) for joint in range(joints))

    def check(self, robot: Robot) -> None:
        """Refuse what this arm cannot have.

        Raises
        ------
        FreedomError
            For a joint that is not there or is named twice, bounds without meaning, or a gear on a joint whose own
            speed limit may come before the rotor's: the limit of a freed joint is the rotor's alone.
        """
        _check_joints("gear_ratios", self.free_gears, robot.joints)
        _check_joints("identical", (joint for group in self.identical for joint in group), robot.joints)
        for gear in self.gears:
            where, bounds = f"gear_ratios.{gear.joint + 1}", [gear.low, gear.high]
            if not 0 < gear.low <= gear.high < np.inf:
                raise FreedomError(where, bounds, "must be [low, high] with 0 < low <= high; the sign is the robot's")
            least = robot.rotor_speed_limit / float(robot.joint_speed_bound[gear.joint])
            if gear.low < least:
                limit = f"at least {least:.6g}, where the joint's own speed limit would come before its rotor's"
                raise FreedomError(where, bounds, limit)

    def admitted(self, gear_ratio: np.ndarray) -> np.ndarray:
        """The gear ratios, shape (n,), with those that are free moved into their bounds."""
        admitted = np.array(gear_ratio, dtype=float)
        for gear in self.gears:
            ratio = admitted[gear.joint]
            admitted[gear.joint] = np.sign(ratio) * np.clip(abs(ratio), gear.low, gear.high)
        return admitted


def _check_joints(field: str, named: Iterable[int], joints: int) -> None:
    seen: set[int] = set()
    for joint in named:
        if not 0 <= joint < joints:
            raise FreedomError(field, joint + 1, f"must be a joint, 1 to {joints}")
        if joint in seen:
            raise FreedomError(field, joint + 1, "names this joint twice")
        seen.add(joint)


@dataclass(frozen=True)
class TieBreak:
    """Which of the designs that are equal within a tolerance is wanted: the lightest, or the nearest to a given one."""

    tolerance: float = 1e-4  # share of the objective that may be given up
    nearest_to: np.ndarray | None = None  # (n, 7) m, in relative distance; the lightest motors when None
