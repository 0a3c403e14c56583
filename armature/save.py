"""Write everything that a server knows of an application, or a sweep's table, into a folder."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from armature.client import Application
from armature.errors import NotFoundError
from armature.sweep import Sweep
from shared.contracts.motions import TaskList

OWN = "own"


def save_results(application: Application, out: Path, request: Mapping[str, Any]) -> Path:
    """Write request, application, tasks, designs, comparison and every motion; what there is not is left out.

    Parameters
    ----------
    out
        Folder in which a new one, named after the application and its id, is made.
    request
        What was submitted: what the answers leave out of it, such as the motor's constants, figures need.

    Returns
    -------
    Path
        The new folder: request.json, inputs.json (the request with every default), application.json, tasks.json,
        design.json, designs.json, comparison.json, and trajectories/task-KKK-METHOD.json.
    """
    status = application.status()
    folder = out / f"{file_name(status.name)}-{status.id}"
    (folder / "trajectories").mkdir(parents=True, exist_ok=True)
    (folder / "request.json").write_text(json.dumps(request, indent=1) + "\n", encoding="utf-8")
    tasks = application.tasks()
    (folder / "inputs.json").write_text(json.dumps(application.inputs(), indent=1) + "\n", encoding="utf-8")
    _write(folder / "application.json", status)
    _write(folder / "tasks.json", TaskList(items=tasks, next_cursor=None))
    _write_if_there(folder / "design.json", application.design)
    _write_if_there(folder / "designs.json", application.designs)
    _write_if_there(folder / "comparison.json", application.comparison)
    for task in tasks:
        for method in [OWN] * (task.own is not None) + list(task.methods):
            trajectory = application.trajectory(task.index, method)
            _write(folder / "trajectories" / f"task-{task.index:03d}-{method}.json", trajectory)
    return folder


def save_sweep(sweep: Sweep, out: Path, request: Mapping[str, Any]) -> Path:
    """Write what was submitted and the table of results: request.json, sweep.json and sweep.csv in a new folder."""
    status = sweep.status()
    folder = out / f"{file_name(status.name)}-{status.id}"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "request.json").write_text(json.dumps(request, indent=1) + "\n", encoding="utf-8")
    _write(folder / "sweep.json", status)
    (folder / "sweep.csv").write_text(sweep.csv(), encoding="utf-8", newline="")
    return folder


def _write(path: Path, content: BaseModel) -> None:
    path.write_text(content.model_dump_json(indent=1) + "\n", encoding="utf-8")


def _write_if_there(path: Path, fetch: Callable[[], BaseModel]) -> None:
    with suppress(NotFoundError):
        _write(path, fetch())


def file_name(name: str) -> str:
    """A name as a part of a file's name, everywhere."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("-.")[:60] or "application"
