"""Robots: presets and uploads."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Response

from api.access import OwnerOf
from api.context import Ctx
from services.jobs.robots import delete_robot, get_robot, list_robots, upload_robot
from shared.contracts.robots import AcceptedRobot, RobotItem, RobotList

router = APIRouter(prefix="/v1/robots", tags=["robots"])


@router.get("")
def list_all(ctx: Ctx, owner: OwnerOf) -> RobotList:
    """Presets and uploaded robots."""
    return RobotList(items=[RobotItem.model_validate(item) for item in list_robots(ctx.engine, owner)])


@router.get("/{robot_id}")
def get_one(robot_id: str, ctx: Ctx) -> dict[str, Any]:
    """A robot in the form that uploads take."""
    return dict(get_robot(ctx.engine, robot_id))


@router.post("", status_code=201)
def upload(body: dict[str, Any], response: Response, ctx: Ctx, owner: OwnerOf) -> AcceptedRobot:
    """Keep a robot, to be named by its id in applications: in the robot format, or a URDF's text with settings."""
    robot_id = upload_robot(ctx.engine, body, owner)
    response.headers["Location"] = f"/v1/robots/{robot_id}"
    return AcceptedRobot(id=robot_id)


@router.delete("/{robot_id}", status_code=204)
def delete(robot_id: str, ctx: Ctx) -> None:
    """Forget an upload; applications that use it keep their copy of it."""
    delete_robot(ctx.engine, robot_id)
