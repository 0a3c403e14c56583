"""`armature export`: motions and designs as files for other programs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer
from pydantic import BaseModel

from armature.cli.consoles import output, print_json
from armature.cli.remote import Id, Json, Url, open_application
from armature.client import DEFAULT_URL, Application
from armature.errors import NotFoundError
from armature.export.files import TABULAR, Format, write_designs, write_motion


class Exported(BaseModel):
    """Files that were written."""

    files: list[str]


def export(
    application_id: Id,
    *,
    kind: Annotated[Format, typer.Option("--format", help="Format of the files.")] = Format.CSV,
    task: Annotated[int | None, typer.Option(min=0, help="Only this task's motion, by its index.")] = None,
    all_tasks: Annotated[bool, typer.Option("--all", help="Every task's motion (the default without --task).")] = False,
    designs: Annotated[bool, typer.Option("--designs", help="The designs instead: csv or parquet.")] = False,
    method: Annotated[str | None, typer.Option(help="own, or a method; default: the application's.")] = None,
    joint_names: Annotated[str | None, typer.Option(help="For ROS and NPZ, joined by commas.")] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="A file for one motion or the designs, else a folder.")] = (
        Path("export")
    ),
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Write motions or designs as CSV, Parquet, NPZ, or ROS's JointTrajectory in JSON or YAML.

    Every column and array has its unit in its name; numbers keep all their digits. An --out that ends with the
    format's suffix is a file.
    """
    if task is not None and all_tasks:
        raise typer.BadParameter("give --task or --all, not both")
    if designs and kind not in TABULAR:
        raise typer.BadParameter(f"--designs: {kind.value} was asked for; designs are tables, csv or parquet")
    names = None if joint_names is None else [name.strip() for name in joint_names.split(",")]
    with open_application(url, application_id) as application:
        if designs:
            written = [_file(out, f"designs{kind.suffix}")]
            write_designs(application.designs(), written[0], kind)
        else:
            written = list(_motions(application, task, method, kind=kind, names=names, out=out))
    if as_json:
        print_json(Exported(files=[str(path) for path in written]))
        return
    for path in written:
        output().print(str(path), soft_wrap=True)


def _motions(
    application: Application,
    task: int | None,
    method: str | None,
    *,
    kind: Format,
    names: list[str] | None,
    out: Path,
) -> Iterator[Path]:
    """Write the motions asked for; of all tasks, those that have none are left out."""
    one = task is not None
    for index in [task] if task is not None else [found.index for found in application.tasks()]:
        with suppress(*(() if one else (NotFoundError,))):
            motion = application.trajectory(index, method)
            name = f"task-{index:03d}-{motion.method}{kind.suffix}"
            path = _file(out, name) if one else _inside(out, name)
            try:
                write_motion(motion, path, kind, names)
            except ValueError as error:
                raise typer.BadParameter(str(error)) from error
            yield path


def _file(out: Path, name: str) -> Path:
    """`out` itself when it is a file's name, else a file inside it."""
    if out.suffix == Path(name).suffix and not out.is_dir():
        out.parent.mkdir(parents=True, exist_ok=True)
        return out
    return _inside(out, name)


def _inside(folder: Path, name: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder / name
