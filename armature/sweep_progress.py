"""Progress of a sweep while it is waited for: a bar in a terminal or a notebook, plain lines elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.spinner import Spinner
from rich.table import Table
from rich.text import Text

from armature.notebook import Bars, NotebookBars, in_notebook
from armature.progress import BAR_WIDTH, NewLines, Note, nothing_to_note
from shared.contracts.sweeps import SweepStatus
from shared.domain import ApplicationState


@contextmanager
def shown_sweep_progress(
    console: Console | None = None, note: Note = nothing_to_note
) -> Iterator[Callable[[SweepStatus], None]]:
    """Give a function that shows a status; call it with every new one."""
    if console is None and in_notebook():
        yield NotebookBars(_rows)
        return
    console = console or Console(file=sys.stderr, highlight=False, markup=False)
    if not console.is_terminal:
        lines = NewLines(console)
        yield lambda status: lines.say(f"{status.state} {_ended(status)} {note()}", plain_line(status, note()))
        return
    with Live(console=console, transient=False, refresh_per_second=8) as live:
        spinner = Spinner("dots")
        yield lambda status: live.update(_bar(status, note(), spinner))


def plain_line(status: SweepStatus, note: str | None = None) -> str:
    """Applications and motions so far, in words."""
    if ApplicationState(status.state).final:
        return status.state
    parts = [f"{_ended(status)} of {len(status.points)} applications", f"{_motions(status)} motions", note or ""]
    return "; ".join(part for part in parts if part)


def _bar(status: SweepStatus, note: str | None, spinner: Spinner) -> Group:
    final, total = ApplicationState(status.state).final, len(status.points)
    table = Table.grid(padding=(0, 2))
    mark = Text("✓", "green") if final else spinner
    bar = ProgressBar(total, _ended(status), width=BAR_WIDTH, complete_style="cyan", finished_style="green")
    table.add_row(mark, "applications", bar, f"{_ended(status)} of {total}")
    remarks = " · ".join(filter(None, [note, f"{_motions(status)} motions"]))
    return Group(table, Text(f"   {remarks}", "dim", no_wrap=True, overflow="ellipsis"))


def _rows(status: SweepStatus) -> Bars:
    ended, total = _ended(status), len(status.points)
    return Bars([("applications", ended, total, f"{ended} of {total}")], [status.state, f"{_motions(status)} motions"])


def _ended(status: SweepStatus) -> int:
    return sum(count for state, count in status.counts.items() if ApplicationState(state).final)


def _motions(status: SweepStatus) -> int:
    return sum(totals.tasks for point in status.points for totals in point.totals.values())
