"""When a call is tried again, and after what pause. Both clients ask here; they differ only in how they sleep."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import httpx

from armature.errors import ServerUnreachableError, problem_of
from armature.retry_after import retry_after_s

WAITS_S = (0.1, 0.2, 0.4, 0.8, 1.6)
"""Pauses before a call is tried again when nobody answers, or the server is busy (503)."""

PATIENCE_S = 60.0
"""How long in all a call waits as a server asks it to (`Retry-After`)."""

OnWait = Callable[[float, str], None]
"""Told how long a call waits [s], and why, before it waits because the server asked it to."""

NOT_FOUND, TOO_MANY, BUSY = 404, 429, 503


@dataclass(frozen=True)
class Policy:
    """How patient a client is.

    Attributes
    ----------
    waits_s
        Pauses between attempts [s] when nobody answers, or the server is busy and does not say for how long.
    patience_s
        How long a call waits in all [s] because the server said `Retry-After`; 0: not at all.
    on_wait
        Told of every such wait before it begins.
    """

    waits_s: tuple[float, ...] = WAITS_S
    patience_s: float = PATIENCE_S
    on_wait: OnWait | None = None


class Attempts:
    """The attempts of one call.

    Every call is safe to repeat, a submission because it carries an idempotency key. A DELETE that is repeated and
    finds nothing was done the time before, when its answer was lost.
    """

    def __init__(self, method: str, url: str, policy: Policy) -> None:
        self._method, self._url, self._patience_s = method, url, policy.patience_s
        self._on_wait = policy.on_wait
        self._waits: Iterator[float] = iter(policy.waits_s)
        self._repeated = False

    def after_error(self, error: httpx.TransportError) -> float:
        """Pause [s] after nobody answered.

        Raises
        ------
        ServerUnreachableError
            It was tried often enough.
        """
        pause = next(self._waits, None)
        if pause is None:
            raise ServerUnreachableError(self._url, str(error) or type(error).__name__) from error
        self._repeated = True
        return pause

    def after_answer(self, answer: httpx.Response) -> float | None:
        """Pause [s] after an answer; None: this answer is the one.

        Raises
        ------
        ProblemError
            It is not a success, and asking again would not help.
        """
        deleted_before = self._method == "DELETE" and self._repeated and answer.status_code == NOT_FOUND
        if answer.is_success or deleted_before:
            return None
        pause = self._pause_of(answer)
        if pause is None:
            raise problem_of(answer)
        self._repeated = True
        return pause

    def _pause_of(self, answer: httpx.Response) -> float | None:
        """As long as the server asks, while patience lasts; else the next of the pauses when it is busy."""
        if answer.status_code not in (TOO_MANY, BUSY):
            return None
        asked = retry_after_s(answer)
        if asked is None:
            return next(self._waits, None) if answer.status_code == BUSY else None
        self._patience_s -= asked
        if self._patience_s < 0:
            return None
        if self._on_wait is not None:
            self._on_wait(asked, problem_of(answer).detail)
        return asked
