"""Read an application from YAML (JSON is YAML)."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

from armature.errors import ApplicationFileError


class _Loader(yaml.SafeLoader):
    """PyYAML's safe loader, with two changes.

    A key given twice is an error: the first would be lost without a word. And 1e-3 is a number, as in YAML 1.2 and
    JSON; PyYAML wants 1.0e-3.
    """

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """As in PyYAML, after looking for keys that come twice."""
        seen: set[str] = set()
        for key, _ in node.value:
            name = str(key.value)
            if name in seen:
                raise yaml.constructor.ConstructorError(None, None, f"{name!r} is given twice", key.start_mark)
            seen.add(name)
        return super().construct_mapping(node, deep)


_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$")
_Loader.add_implicit_resolver("tag:yaml.org,2002:float", _FLOAT, list("-+.0123456789"))


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
        content = yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as error:
        raise ApplicationFileError(f"{path} is not YAML: {_where(error)}") from error
    if not isinstance(content, dict):
        raise ApplicationFileError(f"{path} is not an application: it has no fields such as name, robot, tasks")
    return content


def _where(error: yaml.YAMLError) -> str:
    if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark is not None:
        mark = error.problem_mark
        return f"line {mark.line + 1}, column {mark.column + 1}: {error.problem or error.context}"
    return str(error)
