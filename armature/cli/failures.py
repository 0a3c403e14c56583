"""From an exception to a message for a person and an exit code for a script."""

from __future__ import annotations

import errno
from typing import Any

import typer
from pydantic import ValidationError
from rich.console import Console
from typer.core import TyperGroup

from armature.cli.consoles import messages
from armature.cli.exit_codes import ExitCode
from armature.errors import (
    AccessError,
    ApplicationFileError,
    ArmatureError,
    NotFoundError,
    ProblemError,
    RefusedError,
    ServerUnreachableError,
    TooManyRequestsError,
)
from armature.retries import BUSY, TOO_MANY
from shared.settings import Settings


class Commands(TyperGroup):
    """The commands; what a person can put right ends them with a message, the rest is a fault and has a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command."""
        try:
            return super().invoke(ctx)
        except ArmatureError as error:
            explain(messages(), error)
            raise typer.Exit(exit_code(error)) from error
        except ValidationError as error:
            if error.title != Settings.__name__:
                raise
            explain_settings(messages(), error)
            raise typer.Exit(ExitCode.REFUSED) from error
        except OSError as error:
            if error.filename is None or error.errno == errno.EPIPE:  # whoever read the output has enough
                raise
            _say(messages(), f"{error.filename}: {(error.strerror or str(error)).lower()}")
            raise typer.Exit(ExitCode.ERROR) from error
        except KeyboardInterrupt:
            raise typer.Exit(ExitCode.INTERRUPTED) from None


def exit_code(error: ArmatureError) -> ExitCode:
    """What a script is told."""
    if isinstance(error, RefusedError | ApplicationFileError):
        return ExitCode.REFUSED
    if isinstance(error, NotFoundError):
        return ExitCode.NOT_FOUND
    if isinstance(error, ServerUnreachableError):
        return ExitCode.UNREACHABLE
    if isinstance(error, AccessError):
        return ExitCode.NO_ACCESS
    if isinstance(error, ProblemError) and error.status in (TOO_MANY, BUSY):
        return ExitCode.BUSY
    return ExitCode.ERROR


def explain_settings(console: Console, error: ValidationError) -> None:
    """Which variables of the environment hold what they cannot."""
    for problem in error.errors():
        name = "_".join(["ARMATURE", *map(str, problem["loc"])]).upper()
        _say(console, f"{name} = {problem['input']}: {problem['msg'].lower()}")


def explain(console: Console, error: ArmatureError) -> None:
    """What a person is told."""
    if isinstance(error, TooManyRequestsError):
        again = "" if error.retry_after_s is None else f"; it asks to wait {error.retry_after_s:.0f} s"
        _say(console, f"the server has too much to do: {error.detail}{again}")
        return
    if isinstance(error, ProblemError) and error.errors:
        _say(console, "refused:")
        for problem in error.errors:
            value = "" if problem.value is None else f" = {problem.value}"
            console.print(f"  {problem.field}{value}: {problem.limit}", soft_wrap=True)
        return
    _say(console, str(error))
    if isinstance(error, AccessError):
        _say(console, "give a key in ARMATURE_API_KEY; 'armature key create NAME' makes one")
    if isinstance(error, ServerUnreachableError):
        _say(console, "start one with 'armature up', or name another with --url or ARMATURE_URL")


def _say(console: Console, text: str) -> None:
    console.print(text, style="bold red", soft_wrap=True)
