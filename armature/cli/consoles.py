"""Where things are written: results to standard output, everything about the way there to standard error."""

from __future__ import annotations

import json
import sys
from typing import Any, Literal, TextIO

from pydantic import BaseModel
from rich.console import Console

WIDTH_OF_FILES = 120
"""Columns when the output is no terminal: a pipe has no width, and a wrapped table is of no use."""


def _console(stream: TextIO) -> Console:
    """Without rich's markup: names that people gave may hold brackets."""
    return Console(file=stream, highlight=False, markup=False, width=None if stream.isatty() else WIDTH_OF_FILES)


def output() -> Console:
    """For results."""
    return _console(sys.stdout)


def messages() -> Console:
    """For progress and errors."""
    return _console(sys.stderr)


class Deleted(BaseModel):
    """Answer of every `delete`."""

    id: str
    deleted: Literal[True] = True


def print_json(answer: Any) -> None:
    """A server's answer as it came, or what JSON knows, for programs; at once, though the output may be a pipe."""
    text = answer.model_dump_json(indent=1) if isinstance(answer, BaseModel) else json.dumps(answer, indent=1)
    print(text, flush=True)


def print_deleted(what: str, as_json: bool) -> None:
    """That something is no more."""
    if as_json:
        print_json(Deleted(id=what))
    else:
        output().print(f"{what} deleted")
