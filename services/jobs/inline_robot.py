"""A robot as people send it: in the robot format, or the text of a URDF with settings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from services.codesign.robot import Robot, RobotError
from services.robots.from_urdf import robot_from_urdf
from shared.contracts.application import LONGEST_NAME, MOST_JOINTS
from shared.contracts.errors import FieldError, InvalidInputError, field_errors
from shared.contracts.robots import UrdfRobotRequest


def inline_robot(given: Mapping[str, Any], field: str = "") -> Mapping[str, Any]:
    """The robot format; what is in it is not judged yet.

    Raises
    ------
    InvalidInputError
        For a URDF or settings that describe no arm; errors name fields below `field`.
    """
    if "urdf" not in given:
        return given
    try:
        return robot_from_urdf(UrdfRobotRequest.model_validate(dict(given)))
    except ValidationError as error:
        below = [FieldError(_below(field, e.field), e.value, e.limit) for e in field_errors(error)]
        raise InvalidInputError(below) from error
    except RobotError as error:
        raise InvalidInputError([FieldError(_below(field, error.field), None, error.reason)]) from error


def read_robot(wire: Mapping[str, Any], field: str = "") -> Robot:
    """The robot, or a refusal.

    Raises
    ------
    InvalidInputError
        When it describes no arm, or one that is too large.
    """
    try:
        robot = Robot.from_wire(wire)
    except RobotError as error:
        raise InvalidInputError([FieldError(_below(field, error.field), None, error.reason)]) from error
    if robot.joints > MOST_JOINTS:
        raise InvalidInputError(
            [FieldError(_below(field, "gear_ratio"), robot.joints, f"at most {MOST_JOINTS} joints")]
        )
    if not 0 < len(robot.name) <= LONGEST_NAME or not robot.name.isprintable():
        limit = f"1 to {LONGEST_NAME} characters that can be printed"
        raise InvalidInputError([FieldError(_below(field, "name"), robot.name, limit)])
    return robot


def _below(field: str, name: str) -> str:
    return f"{field}.{name}" if field else name
