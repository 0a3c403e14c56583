"""Read an application from YAML (JSON is YAML)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from armature.errors import ApplicationFileError
from shared.yaml_document import YamlError, read_yaml


def read_application(path: str | Path) -> dict[str, Any]:
    """Read an application's file; what is in it is judged by the server.

    Raises
    ------
    ApplicationFileError
        There is no such file, or it is not YAML, or not a mapping.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ApplicationFileError(f"there is no file {path}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ApplicationFileError(f"{path} cannot be read: {error}") from error
    try:
        content = read_yaml(text)
    except YamlError as error:
        raise ApplicationFileError(f"{path} is not YAML: {error}") from error
    if not isinstance(content, dict):
        raise ApplicationFileError(f"{path} is not an application: it has no fields such as name, robot, tasks")
    return content
