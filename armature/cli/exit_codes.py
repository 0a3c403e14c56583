"""What the `armature` command's exit code says, for scripts."""

from __future__ import annotations

from enum import IntEnum

from shared.domain import ApplicationState


class ExitCode(IntEnum):
    """Exit codes; `armature --help` and docs/terminal.md list them with their meaning."""

    meaning: str

    def __new__(cls, code: int, meaning: str) -> ExitCode:
        """A code that knows what it means."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.meaning = meaning
        return member

    OK = 0, "succeeded"
    ERROR = 1, "error"
    USAGE = 2, "wrong usage"  # typer's own
    REFUSED = 3, "input refused"
    NOT_FOUND = 4, "not found"
    UNREACHABLE = 5, "no server answers"
    NO_ACCESS = 6, "no valid API key"
    BUSY = 7, "the server asks to wait longer than the command does"
    COMPLETED_WITH_FAILURES = 10, "completed, but some solves failed"
    FAILED = 11, "failed"
    CANCELLED = 12, "cancelled"
    INTERRUPTED = 130, "interrupted"


HELP = "Exit codes: " + "; ".join(f"{code.value} {code.meaning}" for code in ExitCode) + "."

_OF_STATE = {
    ApplicationState.COMPLETED_WITH_FAILURES: ExitCode.COMPLETED_WITH_FAILURES,
    ApplicationState.FAILED: ExitCode.FAILED,
    ApplicationState.CANCELLED: ExitCode.CANCELLED,
}


def exit_code_of(state: str) -> ExitCode:
    """Exit code of a command that waited for an application."""
    return _OF_STATE.get(ApplicationState(state), ExitCode.OK)
