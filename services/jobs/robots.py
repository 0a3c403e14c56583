"""Robots people can name: presets, and uploads kept in the database."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy import Engine, select

from services.codesign.robot import preset_names, preset_wire
from services.jobs.inline_robot import inline_robot, read_robot
from services.jobs.owners import Owner, owned_by
from services.jobs.submit import find_robot
from services.jobs.views import NotFoundError
from shared.db.engine import reading, transaction
from shared.db.tables import UploadedRobot
from shared.domain import new_id


def list_robots(engine: Engine, owner: Owner = None) -> list[dict[str, str]]:
    """Presets by name, then uploads by id, newest first."""
    mine = owned_by(owner, UploadedRobot.owner)
    with reading(engine) as session:
        rows = session.scalars(select(UploadedRobot).where(mine).order_by(UploadedRobot.id.desc())).all()
    presets = [
        {"id": name, "name": name, "kind": "preset", "description": str(preset_wire(name).get("description", ""))}
        for name in preset_names()
    ]
    return presets + [
        {"id": row.id, "name": row.name, "kind": "upload", "description": str(row.wire.get("description", ""))}
        for row in rows
    ]


def get_robot(engine: Engine, robot_id: str) -> Mapping[str, Any]:
    """A robot's wire form."""
    if robot_id in preset_names():
        return preset_wire(robot_id)
    wire = find_robot(engine, robot_id)
    if wire is None:
        raise NotFoundError(f"there is no robot {robot_id}")
    return wire


def upload_robot(engine: Engine, wire: Mapping[str, Any], owner: Owner = None) -> str:
    """Store a robot, given in the robot format or as a URDF with settings; returns its id.

    Raises
    ------
    InvalidInputError
        When it does not describe an arm.
    """
    wire = inline_robot(wire)
    row = UploadedRobot(id=new_id(), name=read_robot(wire).name, wire=dict(wire), owner=owner)
    with transaction(engine) as session:
        session.add(row)
    return row.id


def delete_robot(engine: Engine, robot_id: str) -> None:
    """Forget an upload. Applications that were submitted with it keep their copy of it.

    Raises
    ------
    NotFoundError
        There is no such upload; presets stay.
    """
    with transaction(engine) as session:
        row = session.get(UploadedRobot, robot_id)
        if row is None:
            preset = robot_id in preset_names()
            raise NotFoundError(f"{robot_id} is a preset" if preset else f"there is no robot {robot_id}")
        session.delete(row)
