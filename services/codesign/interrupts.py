"""Ctrl-C while CasADi works: the solve stops, and KeyboardInterrupt is raised once CasADi has been left."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_CTRL_C = threading.Event()


def is_interrupted() -> bool:
    """Whether Ctrl-C came and is being kept."""
    return _CTRL_C.is_set()


@contextmanager
def interrupts_kept() -> Iterator[None]:
    """Stop the solve at Ctrl-C, and raise KeyboardInterrupt once this is left.

    Python's own handler would raise inside CasADi, in IPOPT or in a matrix product, and be swallowed there. Within
    another of these, in other threads and where the caller handles the signal nothing changes.
    """
    ours = threading.current_thread() is threading.main_thread()
    if not ours or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, lambda _number, _frame: _CTRL_C.set())
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if _CTRL_C.is_set():
            _CTRL_C.clear()
            raise KeyboardInterrupt
