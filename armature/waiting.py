"""When waiting for something that a server works on is over. Both clients ask here."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any, Protocol, TypeVar

from shared.domain import ApplicationState


class HasState(Protocol):
    """An answer about something that ends."""

    @property
    def state(self) -> str:
        """An `ApplicationState`."""


Status = TypeVar("Status", bound=HasState)
Progress = Callable[[Status], None] | bool | None
"""True: a bar; or a function that is called with every status seen."""
Shown = Callable[[], AbstractContextManager[Callable[[Any], None]]]


@contextmanager
def look_until_final(
    progress: Progress[Status], shown: Shown, *, what: str, timeout_s: float | None
) -> Iterator[Callable[[Status], bool]]:
    """Give a function that takes each status seen, and says whether it is the last.

    Parameters
    ----------
    progress, shown
        Called with every status seen; `shown` gives what `progress=True` means.
    what
        What is waited for, for the message of a time-out.
    timeout_s
        Longest wait [s]; None: for ever.

    Raises
    ------
    TimeoutError
        By the function.
    """
    deadline = None if timeout_s is None else time.monotonic() + timeout_s

    def over(status: Status) -> bool:
        show(status)
        if ApplicationState(status.state).final:
            return True
        if deadline is not None and time.monotonic() > deadline:
            raise TimeoutError(f"{what} is {status.state} after {timeout_s} s")
        return False

    if progress is True:
        with shown() as show:
            yield over
    else:
        show = progress if callable(progress) else _show_nothing
        yield over


def _show_nothing(_: Any) -> None:
    pass
