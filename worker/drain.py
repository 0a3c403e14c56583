"""Shutting down: the worker's parent process tells its solver processes until when they may go on.

SIGTERM reaches the parent alone, and Celery lets the jobs at hand end. A flag in shared memory, made before the fork,
carries the deadline to the children; past it they stop their solves and give the jobs back without counting the
attempt. Where pool processes are spawned and not forked the flag is not shared, and jobs at hand are finished.
"""

from __future__ import annotations

import mmap
import struct
import time

_DEADLINE = struct.Struct("d")
_shared = mmap.mmap(-1, _DEADLINE.size)  # zero: no shutdown


def begin_drain(grace_s: float) -> None:
    """Let solves run for `grace_s` seconds more."""
    _shared[:] = _DEADLINE.pack(time.monotonic() + grace_s)


def draining() -> bool:
    """Whether the worker is shutting down."""
    return _deadline() > 0


def drained() -> bool:
    """Whether the worker is shutting down and the grace is over."""
    return 0 < _deadline() <= time.monotonic()


def _deadline() -> float:
    deadline: float = _DEADLINE.unpack(_shared[:])[0]
    return deadline
