"""The `armature` command as a process, and what is left of it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

ARMATURE = (sys.executable, "-m", "armature.cli.main")
EXAMPLES = Path(__file__).parents[2] / "examples"
QUICK = {"scheme": "radau", "degree": 1, "intervals": 20, "control": "voltage"}
"""The paper's transcription on a coarse grid: nothing here depends on accuracy."""

TIMEOUT_S = 120.0


def environment(home: Path, **more: str) -> dict[str, str]:
    """Of a user whose ARMATURE_HOME is `home` and who set nothing else of ours."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("ARMATURE_")}
    return {**inherited, "ARMATURE_HOME": str(home), **more}


def armature(home: Path, *arguments: str | Path, **more: str) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    command = [*ARMATURE, *map(str, arguments)]
    return subprocess.run(
        command, capture_output=True, text=True, env=environment(home, **more), timeout=TIMEOUT_S, check=False
    )


def start(home: Path, *arguments: str | Path) -> subprocess.Popen[str]:
    """Start a command that will be signalled, in a session of its own like a shell's job."""
    return subprocess.Popen(
        [*ARMATURE, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(home),
        start_new_session=True,
    )


def read_until(stream: Any, text: str) -> list[str]:
    """Lines of a stream up to the first that holds `text`."""
    lines = []
    for line in stream:
        lines.append(line)
        if text in line:
            return lines
    raise AssertionError(f"the process ended without saying {text!r}:\n{''.join(lines)}")


def processes_of(home: Path) -> Sequence[str]:
    """Every process, however deep and whoever's child by now, that was started with this ARMATURE_HOME."""
    listing = subprocess.run(["ps", "axeww", "-o", "command="], capture_output=True, text=True, check=True).stdout
    return [line for line in listing.splitlines() if f"ARMATURE_HOME={home}" in line]


def wait_until_gone(home: Path, timeout_s: float) -> Sequence[str]:
    """What is left of a home's processes when none is left, or after `timeout_s`."""
    deadline = time.monotonic() + timeout_s
    while (left := processes_of(home)) and time.monotonic() < deadline:
        time.sleep(0.1)
    return left


def interrupt(process: subprocess.Popen[str]) -> tuple[str, str]:
    """Ctrl-C in the terminal: SIGINT to the foreground process group; returns the rest of what was printed."""
    os.killpg(process.pid, signal.SIGINT)
    return process.communicate(timeout=TIMEOUT_S)


def quick_copy(example: str, folder: Path) -> Path:
    """An example on a coarse grid."""
    content = yaml.safe_load((EXAMPLES / example).read_text(encoding="utf-8"))
    path = folder / example
    path.write_text(yaml.safe_dump({**content, "transcription": QUICK}), encoding="utf-8")
    return path
