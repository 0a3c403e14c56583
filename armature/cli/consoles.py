"""Where things are written: results to standard output, everything about the way there to standard error."""

from __future__ import annotations

import sys
from typing import TextIO

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


def print_json(answer: BaseModel) -> None:
    """A server's answer as it came, for programs."""
    sys.stdout.write(answer.model_dump_json(indent=1) + "\n")
