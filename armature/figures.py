"""What figures are drawn from, asked of a server."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from armature.client import Application
from armature.errors import NotFoundError
from shared.contracts.motions import TaskList, Trajectory

if TYPE_CHECKING:
    from services.report.answers import Answers

Found = TypeVar("Found")


def answers_of(application: Application) -> Answers:
    """Everything about an application, with the middle task's motion; what there is not is None."""
    from services.codesign.motor_data import MotorData  # slow to import
    from services.codesign.robot import Robot
    from services.report.answers import Answers, middle_task

    status, inputs = application.status(), application.inputs()
    tasks = TaskList(items=application.tasks(), next_cursor=None)
    motion: Trajectory | None = _if_there(lambda: application.trajectory(middle_task(tasks)))
    given = {name: value for name, value in inputs["motor"].items() if value}
    return Answers(
        application=status,
        tasks=tasks,
        design=_if_there(application.design),
        designs=_if_there(application.designs),
        comparison=_if_there(application.comparison),
        motions=() if motion is None else (motion,),
        motor=MotorData.from_wire(given),
        robot=Robot.from_wire(inputs["robot"]),
    )


def _if_there(fetch: Callable[[], Found]) -> Found | None:
    try:
        return fetch()
    except NotFoundError:
        return None
