"""Wait for what a server works on."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol, TypeVar

from shared.domain import ApplicationState


class HasState(Protocol):
    """An answer about something that ends."""

    @property
    def state(self) -> str:
        """An `ApplicationState`."""


Status = TypeVar("Status", bound=HasState)


def until_final(
    ask: Callable[[], Status],
    progress: Callable[[Status], None] | None,
    *,
    what: str,
    timeout_s: float | None,
    poll_s: float,
) -> Status:
    """Ask again and again, until the state is a final one.

    Parameters
    ----------
    progress
        Called with every status seen.
    what
        What is waited for, for the message of a time-out.
    timeout_s, poll_s
        Longest wait (None: for ever) and pause between two questions [s].

    Raises
    ------
    TimeoutError
    """
    deadline = None if timeout_s is None else time.monotonic() + timeout_s
    while True:
        status = ask()
        if progress is not None:
            progress(status)
        if ApplicationState(status.state).final:
            return status
        if deadline is not None and time.monotonic() > deadline:
            raise TimeoutError(f"{what} is {status.state} after {timeout_s} s")
        time.sleep(poll_s)
