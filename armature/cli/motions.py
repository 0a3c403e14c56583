"""Commands about one task: its motion, and how its solve went."""

from __future__ import annotations

from typing import Annotated

import typer

from armature.cli.consoles import output, print_json
from armature.cli.layout import new_table, print_table
from armature.cli.remote import Id
from armature.cli.server import Json, Url, open_application
from armature.client import DEFAULT_URL

Task = Annotated[int, typer.Argument(metavar="TASK", min=0, help="The task's index, from tasks.", show_default=False)]
Method = Annotated[str | None, typer.Option(help="own, or a method; default: the application's.")]
LINES = 20


def trajectory(
    application_id: Id,
    task: Task,
    method: Method = None,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """A task's motion: where each joint is, at some twenty of its points; `export` writes all of it."""
    with open_application(url, application_id) as application:
        motion = application.trajectory(task, method)
    if as_json:
        print_json(motion)
        return
    joints = range(len(motion.joint_position_rad[0]))
    table = new_table("time\ns", *(f"joint {k + 1}\nrad" for k in joints), left=0)
    last = len(motion.time_s) - 1
    for point in sorted({round(k * last / LINES) for k in range(LINES + 1)}):
        positions = motion.joint_position_rad[point]
        table.add_row(f"{motion.time_s[point]:.4f}", *(f"{position:+.4f}" for position in positions))
    print_table(output(), f"Task {motion.task} ({motion.method}), joint positions", table)


def log(
    application_id: Id,
    task: Task,
    method: Method = None,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """How a task's solve went, iteration by iteration; failed ones too."""
    with open_application(url, application_id) as application:
        found = application.log(task, method)
    if as_json:
        print_json(found)
        return
    out = output()
    out.print(f"Task {found.task} ({found.method}): {found.solver_status or 'no solve'}", style="bold")
    if found.reason:
        out.print(found.reason, soft_wrap=True)
    table = new_table("attempt", "iteration", "objective\nscaled", left=0)
    for step in found.iterations:
        table.add_row(str(step.attempt), str(step.iteration), f"{step.objective:.6g}")
    out.print(table)
