"""What the `armature` command's exit code says, for scripts."""

from __future__ import annotations

from enum import IntEnum

from shared.domain import ApplicationState


class ExitCode(IntEnum):
    """Exit codes; `armature --help` lists them."""

    OK = 0
    ERROR = 1
    USAGE = 2  # typer's own
    REFUSED = 3
    NOT_FOUND = 4
    UNREACHABLE = 5
    COMPLETED_WITH_FAILURES = 10
    FAILED = 11
    CANCELLED = 12
    INTERRUPTED = 130


HELP = (
    "Exit codes: 0 succeeded; 1 error; 2 wrong usage; 3 input refused; 4 not found; 5 no server answers; "
    "10 completed, but some solves failed; 11 failed; 12 cancelled; 130 interrupted."
)

_OF_STATE = {
    ApplicationState.COMPLETED_WITH_FAILURES: ExitCode.COMPLETED_WITH_FAILURES,
    ApplicationState.FAILED: ExitCode.FAILED,
    ApplicationState.CANCELLED: ExitCode.CANCELLED,
}


def exit_code_of(state: str) -> ExitCode:
    """Exit code of a command that waited for an application."""
    return _OF_STATE.get(ApplicationState(state), ExitCode.OK)
