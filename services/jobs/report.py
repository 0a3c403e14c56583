"""Everything that a report on an application is made from, out of the store."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeVar

from sqlalchemy import Engine

from services.codesign.comparison import OWN
from services.jobs import results, views
from services.jobs.views import NotFoundError
from services.report.answers import Answers, middle_task
from services.report.page import Report
from shared.contracts.motions import TaskList, Trajectory

Found = TypeVar("Found")


def report_of(engine: Engine, application_id: str) -> Report:
    """What is known so far; a report can be made of an application that still runs.

    Raises
    ------
    NotFoundError
        There is no such application.
    """
    status = views.status(engine, application_id)
    meaning = results.inputs(engine, application_id)
    tasks = views.tasks(engine, application_id, 0, status.tasks)
    answers = Answers(
        application=status,
        tasks=tasks,
        design=_if_there(lambda: results.design(engine, application_id, None)),
        designs=_if_there(lambda: results.designs(engine, application_id)),
        comparison=_if_there(lambda: results.comparison(engine, application_id)),
        motions=_motion(engine, application_id, tasks, status.method),
        motor=meaning.build_motor(),
        robot=meaning.arm,
    )
    content = [task.model_dump(mode="json") for task in meaning.tasks]
    return Report(answers, content, meaning.as_request(status.name, status.tags))


def _motion(engine: Engine, application_id: str, tasks: TaskList, method: str) -> tuple[Trajectory, ...]:
    """The middle task's, or that of the task nearest to it which has one; none when it was taken back meanwhile."""
    middle = middle_task(tasks)
    for task in sorted(tasks.items, key=lambda task: abs(task.index - middle)):
        name = method if method in task.methods else None if task.own is None else OWN
        if name is not None:
            found = _if_there(partial(results.trajectory, engine, application_id, task.index, name))
            return () if found is None else (found,)
    return ()


def _if_there(read: Callable[[], Found]) -> Found | None:
    try:
        return read()
    except NotFoundError:
        return None
