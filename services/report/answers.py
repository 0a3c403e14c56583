"""What figures are made from: the wire answers about one application, in memory or from the folder of JSON files."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

from services.codesign.motor_data import MotorData
from services.codesign.robot import Robot, preset_names
from shared.contracts.comparisons import ComparisonAnswer, DesignAnswer, DesignsAnswer
from shared.contracts.motions import TaskList, Trajectory
from shared.contracts.states import ApplicationStatus

Answer = TypeVar("Answer", bound=BaseModel)

INPUTS_FILE = "inputs.json"
"""The application with every default filled in, its robot in full, beside the answers."""
REQUEST_FILE = "request.json"
"""The application as it was submitted."""


@dataclass(frozen=True)
class Answers:
    """Everything about one application; what it has not is None."""

    application: ApplicationStatus
    tasks: TaskList
    design: DesignAnswer | None
    designs: DesignsAnswer | None
    comparison: ComparisonAnswer | None
    motions: tuple[Trajectory, ...]  # those to draw
    motor: MotorData  # constants of the application
    robot: Robot | None  # None for an uploaded robot: the answers name it only


def read_answers(folder: Path) -> Answers:
    """Read what `armature run` wrote; of the motions only the middle task's, with the application's method.

    Parameters
    ----------
    folder
        With application.json, tasks.json, and so on.

    Raises
    ------
    FileNotFoundError
        There is no application.json or tasks.json.
    """
    application = ApplicationStatus.model_validate_json((folder / "application.json").read_bytes())
    tasks = TaskList.model_validate_json((folder / "tasks.json").read_bytes())
    request = _request(folder, INPUTS_FILE) or _request(folder, REQUEST_FILE)
    motion = _read(folder / "trajectories" / f"task-{middle_task(tasks):03d}-{application.method}.json", Trajectory)
    return Answers(
        application=application,
        tasks=tasks,
        design=_read(folder / "design.json", DesignAnswer),
        designs=_read(folder / "designs.json", DesignsAnswer),
        comparison=_read(folder / "comparison.json", ComparisonAnswer),
        motions=() if motion is None else (motion,),
        motor=MotorData.from_wire({key: value for key, value in request.get("motor", {}).items() if value}),
        robot=robot_of(request.get("robot", application.robot)),
    )


def middle_task(tasks: TaskList) -> int:
    """Index of the task in the middle of the list: of a grid, the middle stroke with the middle payload."""
    return len(tasks.items) // 2


def robot_of(named: str | dict[str, Any]) -> Robot | None:
    """The robot of a request: a preset, one given inline, or None for the id of an uploaded one."""
    if isinstance(named, dict):
        return Robot.from_wire(named)
    return Robot.preset(named) if named in preset_names() else None


def _request(folder: Path, name: str) -> dict[str, Any]:
    path = folder / name
    request: dict[str, Any] = json.loads(path.read_bytes()) if path.exists() else {}
    return request


def _read(path: Path, kind: type[Answer]) -> Answer | None:
    return kind.model_validate_json(path.read_bytes()) if path.exists() else None
