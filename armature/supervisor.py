"""Keeps the service's processes, and lets none of them outlive the process that asked for them.

It runs as a process of its own: ``python -m armature.supervisor``. Its standard input is a pipe from whoever started
it. The first line says what to start; the end of the pipe means stop. The pipe ends when its owner closes it, returns,
crashes or is killed, so there is one way to stop and it cannot be missed, on every POSIX system.

Each process leads a session of its own: Ctrl-C in the terminal does not reach it, and all its children (a worker's
pool, a compiler) can be ended together.

Only the standard library is imported, so that it starts at once.
"""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from types import FrameType

LOOK_EVERY_S = 0.1
"""How often it looks whether a process has ended."""

_hurry = False


@dataclass(frozen=True)
class ProcessSpec:
    """One process to keep. When all have to stop, they are asked in the order given."""

    name: str
    command: Sequence[str]
    log: str  # file that takes what it prints
    grace_s: float  # from SIGTERM to SIGKILL


@dataclass(frozen=True)
class Ended:
    """Report about a process that ended by itself."""

    name: str
    exit_code: int  # negative: the signal that killed it


def main() -> int:
    """Start what the first line of standard input says; returns 0 when asked to stop, 1 when a process ended."""
    # Handlers rather than SIG_IGN, which the processes would inherit.
    signal.signal(signal.SIGINT, lambda *_: None)
    signal.signal(signal.SIGHUP, lambda *_: None)
    signal.signal(signal.SIGTERM, _stop_at_once)
    specs = [ProcessSpec(**spec) for spec in json.loads(sys.stdin.readline() or "[]")]
    children: list[tuple[ProcessSpec, subprocess.Popen[bytes]]] = []
    try:
        for spec in specs:
            children.append((spec, _start(spec)))  # noqa: PERF401 - one that cannot start must not hide the others
        _report({spec.name: child.pid for spec, child in children})
        ended = _watch(children)
        if ended is not None:
            _report(asdict(ended))
        return 0 if ended is None else 1
    finally:
        for spec, child in children:
            _stop(child, spec.grace_s)


def _stop_at_once(_number: int, _frame: FrameType | None) -> None:
    global _hurry  # noqa: PLW0603 - a signal handler has nowhere else to put it
    _hurry = True


def _start(spec: ProcessSpec) -> subprocess.Popen[bytes]:
    with Path(spec.log).open("ab") as log:
        return subprocess.Popen(
            spec.command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, start_new_session=True
        )


def _watch(children: Sequence[tuple[ProcessSpec, subprocess.Popen[bytes]]]) -> Ended | None:
    """Wait until the pipe ends (None), somebody is in a hurry (None), or a process ends."""
    while not _hurry:
        readable, _, _ = select.select([sys.stdin], [], [], LOOK_EVERY_S)
        if readable and not os.read(sys.stdin.fileno(), 4096):
            return None
        for spec, child in children:
            if child.poll() is not None:
                return Ended(spec.name, child.returncode)
    return None


def _stop(child: subprocess.Popen[bytes], grace_s: float) -> None:
    """SIGTERM to a process, and after its grace, or when it ended and left children behind, SIGKILL to its session."""
    deadline = time.monotonic() + grace_s
    child.terminate()
    while child.poll() is None and time.monotonic() < deadline and not _hurry:
        time.sleep(0.02)
    with suppress(ProcessLookupError, PermissionError):  # PermissionError: macOS, for a group of zombies
        os.killpg(child.pid, signal.SIGKILL)
    child.wait()


def _report(content: dict[str, object] | dict[str, int]) -> None:
    """One line to whoever started us, who may be gone."""
    with suppress(BrokenPipeError):
        print(json.dumps(content), flush=True)


if __name__ == "__main__":
    sys.exit(main())
