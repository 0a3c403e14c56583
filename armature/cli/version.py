"""`armature --version`."""

from __future__ import annotations

from importlib.metadata import version

import typer

from armature.cli.consoles import output


def print_version(wanted: bool) -> None:
    """Print the version and end, if it was asked for."""
    if wanted:
        output().print(f"armature {version('armature-codesign')}")
        raise typer.Exit
