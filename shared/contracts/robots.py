"""Robots on the wire: what people say about an arm beside its URDF, and the list of those there are."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BaseModel, Field

from shared.contracts.application import MOST_JOINTS, Name
from shared.contracts.strict import Strict

Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
PerJoint = float | Annotated[list[float], Field(max_length=MOST_JOINTS)] | dict[str, float]
"""One number for all joints, one for each in order, or by the joints' names in the URDF."""


class MotorMount(Strict):
    """Where a joint's motor sits."""

    link: str | None = Field(None, description="the link that carries the stator; default: the joint's parent")
    xyz_m: Vector = Field([0.0, 0.0, 0.0], description="centre of the motor, in that link's frame")


class UrdfRobotRequest(Strict):
    """An arm from the text of a URDF, and what a URDF does not know."""

    urdf: str
    name: Name | None = Field(None, description="default: the URDF's")
    description: str = Field("", max_length=2000)
    base_link: str | None = Field(None, description="default: the link without a parent")
    tip_link: str | None = Field(None, description="needed when the tree branches")
    gear_ratio: PerJoint = Field(description="rotor turns per joint turn; negative where the gear reverses")
    rotor_speed_limit_rad_s: float = Field(100 * math.pi, gt=0)
    joint_speed_limit_rad_s: PerJoint | None = Field(None, description="default: the URDF's velocity limits")
    joint_position_limit_rad: dict[str, Annotated[list[float], Field(min_length=2, max_length=2)]] = Field(
        default_factory=dict, description="[lower, upper] by joint; default: the URDF's, 2 pi either way if continuous"
    )
    motor_mounts: dict[str, MotorMount] = Field(default_factory=dict, description="by joint; default: at its origin")
    viscous_friction_Nms_rad: PerJoint | None = Field(None, description="joint side; default: the URDF's damping")
    coulomb_friction_Nm: PerJoint | None = Field(None, description="joint side; default: the URDF's friction")
    payload_position_m: Vector = Field([0.0, 0.0, 0.0], description="centre of the payload in the tip link's frame")
    gravity_m_s2: Vector = Field([0.0, 0.0, -9.81], description="in the base link's frame")


class RobotItem(BaseModel):
    """A robot in a list."""

    id: str = Field(description="to be named in applications")
    name: str
    kind: Literal["preset", "upload"]
    description: str


class RobotList(BaseModel):
    """Presets by name, then uploads, newest first."""

    items: list[RobotItem]
    next_cursor: None = None


class AcceptedRobot(BaseModel):
    """Answer to an upload."""

    id: str
