"""Read an application or a sweep from YAML (JSON is YAML), and the files that it names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from armature.errors import ApplicationFileError
from shared.yaml_document import YamlError, read_yaml


def read_application(path: str | Path) -> dict[str, Any]:
    """Read an application's file; what is in it is judged by the server.

    A robot given as ``{urdf: FILE, ...}`` gets the file's text in its place, FILE beside the application: the server
    opens no files.

    Raises
    ------
    ApplicationFileError
        There is no such file, or it is not YAML, or not a mapping, or a sweep.
    """
    content = _read_mapping(Path(path), "an application: it has no fields such as name, robot, tasks")
    if "axes" in content and "application" in content:
        raise ApplicationFileError(f"{path} is a sweep, not an application: see 'armature sweep'")
    return _with_robot(content, Path(path).parent)


def read_sweep(path: str | Path) -> dict[str, Any]:
    """Read a sweep's file. Its base application is a mapping, or the name of a file beside it.

    Raises
    ------
    ApplicationFileError
        As of `read_application`.
    """
    content = _read_mapping(Path(path), "a sweep: it has no fields such as name, application, axes")
    base, folder = content.get("application"), Path(path).parent
    if isinstance(base, str):
        content["application"] = read_application(folder / base)
    elif isinstance(base, dict):
        content["application"] = _with_robot(base, folder)
    return content


def _with_robot(application: dict[str, Any], folder: Path) -> dict[str, Any]:
    robot = application.get("robot")
    return application | {"robot": _with_urdf_text(robot, folder)} if isinstance(robot, dict) else application


def read_robot(path: str | Path) -> dict[str, Any]:
    """Read a robot's file: the robot format in JSON or YAML, or a URDF's settings as in an application.

    A settings file may name its URDF under `urdf`, and keep everything under `robot`, as an application does.
    """
    content = _read_mapping(Path(path), "a robot: it has no fields such as name, urdf, gear_ratio")
    robot = content["robot"] if isinstance(content.get("robot"), dict) else content
    return _with_urdf_text(robot, Path(path).parent)


def _read_mapping(path: Path, what: str) -> dict[str, Any]:
    try:
        content = read_yaml(_read_text(path))
    except YamlError as error:
        raise ApplicationFileError(f"{path} is not YAML: {error}") from error
    if not isinstance(content, dict):
        raise ApplicationFileError(f"{path} is not {what}")
    return content


def _with_urdf_text(robot: dict[str, Any], folder: Path) -> dict[str, Any]:
    named = robot.get("urdf")
    if not isinstance(named, str) or "<" in named:
        return robot
    return robot | {"urdf": _read_text(folder / named)}


def _read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ApplicationFileError(f"there is no file {path}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ApplicationFileError(f"{path} cannot be read: {error}") from error
