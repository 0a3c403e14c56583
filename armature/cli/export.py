"""`armature export`: motions and designs as files for other programs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import typer
from pydantic import BaseModel

from armature.cli.consoles import messages, output, print_json
from armature.cli.exit_codes import ExitCode
from armature.cli.remote import Id
from armature.cli.server import Json, Url, open_application
from armature.client import DEFAULT_URL, Application
from armature.errors import NotFoundError
from armature.export.files import TABULAR, Format, write_designs, write_motion
from shared.contracts.motions import TaskResult, Trajectory


class LeftOut(BaseModel):
    """A task without the motion that was asked for."""

    task: int
    name: str
    reason: str


class Exported(BaseModel):
    """Files that were written, and tasks that have none."""

    files: list[str]
    left_out: list[LeftOut]


def export(
    application_id: Id,
    *,
    kind: Annotated[Format, typer.Option("--format", help="Format of the files.")] = Format.CSV,
    task: Annotated[int | None, typer.Option(min=0, help="Only this task's motion, by its index.")] = None,
    all_tasks: Annotated[bool, typer.Option("--all", help="Every task's motion (the default without --task).")] = False,
    designs: Annotated[bool, typer.Option("--designs", help="The designs instead: csv or parquet.")] = False,
    method: Annotated[str | None, typer.Option(help="own, or a method; default: the application's.")] = None,
    joint_names: Annotated[str | None, typer.Option(help="For ROS, joint-csv and NPZ, joined by commas.")] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="A file for one motion or the designs, else a folder.")] = (
        Path("export")
    ),
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Write motions or designs as CSV, Parquet, NPZ, or ROS's JointTrajectory in JSON or YAML.

    Every column and array has its unit in its name; numbers keep all their digits. `joint-csv` has position, speed,
    acceleration and torque joint by joint, under the joints' names. An --out that ends with the format's suffix is a
    file. Tasks that have no motion are named; the exit code is 10 then.
    """
    if task is not None and all_tasks:
        raise typer.BadParameter("give --task or --all, not both")
    if designs and kind not in TABULAR:
        raise typer.BadParameter(f"--designs: {kind.value} was asked for; designs are tables, csv or parquet")
    names = None if joint_names is None else [name.strip() for name in joint_names.split(",")]
    left_out: list[LeftOut] = []
    with open_application(url, application_id) as application:
        if designs:
            written = [_file(out, f"designs{kind.suffix}")]
            write_designs(application.designs(), written[0], kind)
        elif task is not None:
            motion = application.trajectory(task, method)
            written = [_file(out, _name(motion, kind))]
            _write(motion, written[0], kind, names)
        else:
            written = list(_all_motions(application, method, kind=kind, names=names, out=out, left_out=left_out))
    _report(written, left_out, as_json)


def _all_motions(
    application: Application,
    method: str | None,
    *,
    kind: Format,
    names: Sequence[str] | None,
    out: Path,
    left_out: list[LeftOut],
) -> Iterator[Path]:
    """Write every task's motion; tasks that have none are added to `left_out`."""
    for found in application.tasks():
        try:
            motion = application.trajectory(found.index, method)
        except NotFoundError as error:
            left_out.append(_without_motion(found, error))
            continue
        path = out / _name(motion, kind)
        _write(motion, path, kind, names)
        yield path


def _without_motion(task: TaskResult, error: NotFoundError) -> LeftOut:
    return LeftOut(task=task.index, name=task.name, reason=task.reason or error.detail)


def _write(motion: Trajectory, path: Path, kind: Format, names: Sequence[str] | None) -> None:
    try:
        write_motion(motion, path, kind, names)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error


def _name(motion: Trajectory, kind: Format) -> str:
    return f"task-{motion.task:03d}-{motion.method}{kind.suffix}"


def _file(out: Path, name: str) -> Path:
    """`out` itself when it is a file's name, else a file inside it."""
    return out if out.suffix == Path(name).suffix and not out.is_dir() else out / name


def _report(written: Sequence[Path], left_out: Sequence[LeftOut], as_json: bool) -> None:
    """Say what was written and what not; 4 when there was nothing to write, 10 when something was missing."""
    if as_json:
        print_json(Exported(files=[str(path) for path in written], left_out=list(left_out)))
    else:
        for path in written:
            output().print(str(path), soft_wrap=True)
    for task in left_out:
        messages().print(f"left out: task {task.task}, {task.name}: {task.reason}", soft_wrap=True)
    if left_out:
        raise typer.Exit(ExitCode.COMPLETED_WITH_FAILURES if written else ExitCode.NOT_FOUND)
