"""Read an application from YAML (JSON is YAML), and the URDF that it names."""

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
        There is no such file, or it is not YAML, or not a mapping.
    """
    content = _read_mapping(Path(path), "an application: it has no fields such as name, robot, tasks")
    if isinstance(content.get("robot"), dict):
        content["robot"] = _with_urdf_text(content["robot"], Path(path).parent)
    return content


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
