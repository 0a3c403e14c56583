"""Progress of an application while it is waited for: bars in a terminal or a notebook, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.spinner import Spinner
from rich.table import Table
from rich.text import Text

from armature.notebook import Bars, NotebookBars, in_notebook
from shared.contracts.states import ApplicationStatus, LatestResult, Progress, StageProgress
from shared.domain import ApplicationState

STAGES = {
    "codesign": "co-design, task by task",
    "reconcile": "one design for all tasks",
    "motions": "every motion again with it",
    "shared_optimum": "the best design for all tasks at once",
    "shared_motions": "every motion with that one",
}
"""What a stage does, in words."""

COMPILING = "compiling derivatives (once for this machine)"

PLAIN_EVERY_S = 5.0
"""Longest silence between two plain lines while something moves."""

BAR_WIDTH = 32

Note = Callable[[], str | None]
"""Something to say besides the counts, such as that kernels are being compiled."""

Show = Callable[[ApplicationStatus], None]


def nothing_to_note() -> str | None:
    """The default."""
    return None


@contextmanager
def shown_progress(console: Console | None = None, note: Note = nothing_to_note) -> Iterator[Show]:
    """Give a function that shows a status; call it with every new one."""
    if console is None and in_notebook():
        yield NotebookBars(_rows)
        return
    console = console or Console(file=sys.stderr, highlight=False, markup=False)
    if not console.is_terminal:
        yield PlainProgress(console, note)
        return
    with Live(console=console, transient=False, refresh_per_second=8) as live:
        spinner = Spinner("dots")
        yield lambda status: live.update(_bars(status, note(), spinner))


class PlainProgress:
    """Lines for logs: one when a stage moves on, one every few seconds in between."""

    def __init__(self, console: Console, note: Note, every_s: float = PLAIN_EVERY_S) -> None:
        self._lines, self._note = NewLines(console, every_s), note

    def __call__(self, status: ApplicationStatus) -> None:
        """Print a line, if there is something new to say."""
        note = None if ApplicationState(status.state).final else self._note()
        stage = current_stage(status)
        key = f"{status.state} {None if stage is None else stage.name} {note} {status.progress.compiling}"
        self._lines.say(key, _plain_line(status, stage, note))


class NewLines:
    """Prints a line when its key is new, or when the line is and the last one was some time ago."""

    def __init__(self, console: Console, every_s: float = PLAIN_EVERY_S) -> None:
        self._console, self._every_s = console, every_s
        self._last_line, self._last_key, self._last_time = "", "", 0.0

    def say(self, key: str, line: str) -> None:
        """Print the line, or nothing."""
        due = time.monotonic() - self._last_time >= self._every_s
        if key != self._last_key or (due and line != self._last_line):
            self._console.print(line, soft_wrap=True)
            self._last_line, self._last_key, self._last_time = line, key, time.monotonic()


def current_stage(status: ApplicationStatus) -> StageProgress | None:
    """The first stage that is not finished."""
    return next((stage for stage in status.progress.stages if done(stage) < stage.total), None)


def done(stage: StageProgress) -> int:
    """Jobs of a stage that are at their end."""
    return stage.succeeded + stage.failed + stage.dead + stage.cancelled


def _plain_line(status: ApplicationStatus, stage: StageProgress | None, note: str | None) -> str:
    if stage is None or status.state != ApplicationState.RUNNING:
        parts = [status.state]
    else:
        parts = [f"{STAGES[stage.name]}: {_counts(stage)}"]
    return "; ".join([*parts, *_remarks(status, note)])


def _counts(stage: StageProgress) -> str:
    failed = stage.failed + stage.dead
    return f"{done(stage)} of {stage.total}" + (f" ({failed} failed)" if failed else "")


def _bars(status: ApplicationStatus, note: str | None, spinner: Spinner) -> Group:
    table = Table.grid(padding=(0, 2))
    now = current_stage(status)
    for stage in status.progress.stages:
        busy = now is stage and status.finished_at is None
        mark = spinner if busy else Text("✓", "green") if done(stage) >= stage.total else Text(" ")
        bar = ProgressBar(stage.total, done(stage), width=BAR_WIDTH, complete_style="cyan", finished_style="green")
        table.add_row(mark, STAGES[stage.name], bar, _counts(stage))
    remarks = Text("   " + " · ".join(_remarks(status, note)), "dim", no_wrap=True, overflow="ellipsis")
    return Group(table, remarks)


def _rows(status: ApplicationStatus) -> Bars:
    stages = [(STAGES[stage.name], done(stage), stage.total, _counts(stage)) for stage in status.progress.stages]
    return Bars(stages, [status.state, *_remarks(status, None)])


def _remarks(status: ApplicationStatus, note: str | None) -> list[str]:
    progress = status.progress
    remarks = [note] if note else []
    if progress.best is not None:
        remarks.append(f"best {_result(progress.best)}")
    if progress.last is not None:
        remarks.append(f"last {_result(progress.last)}")
    left = time_left(progress)
    if left is not None and status.finished_at is None and note is None:
        remarks.append(left)
    return remarks


def time_left(progress: Progress) -> str | None:
    """What can be said of the time left; while derivatives are compiled, that they are."""
    if progress.compiling:
        return COMPILING
    return None if progress.eta_s is None else f"about {duration(progress.eta_s)} left"


def _result(result: LatestResult) -> str:
    with_design = "" if result.method == "own" else f", {result.method}"
    return f"{result.value:.4g} {result.unit} ({result.task}{with_design})"


def duration(seconds: float) -> str:
    """A time for people."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
