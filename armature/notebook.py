"""Progress bars in a notebook: one output that is replaced, made of HTML that every front end shows."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from rich.console import Console


def in_notebook() -> bool:
    """Whether this runs in a notebook's kernel."""
    return Console().is_jupyter


@dataclass(frozen=True)
class Bars:
    """What is shown.

    Attributes
    ----------
    rows
        Name, how many are done, of how many, and that in words.
    remarks
        Said below.
    """

    rows: Sequence[tuple[str, int, int, str]]
    remarks: Sequence[str]

    def html(self) -> str:
        """A table of bars."""
        rows = "".join(
            f'<tr><th style="text-align: left; font-weight: normal">{escape(name)}</th>'
            f'<td><progress value="{done}" max="{max(total, 1)}" aria-label="{escape(name)}"></progress></td>'
            f'<td style="text-align: left">{escape(words)}</td></tr>'
            for name, done, total, words in self.rows
        )
        return f"<table>{rows}</table><div>{escape(' · '.join(self.remarks))}</div>"

    def text(self) -> str:
        """For front ends without HTML."""
        return "; ".join([*(f"{name}: {words}" for name, _, _, words in self.rows), *self.remarks])


class NotebookBars:
    """Shows every status that it is called with in one output of the cell.

    Parameters
    ----------
    bars_of
        From a status to what is shown.
    """

    def __init__(self, bars_of: Callable[[Any], Bars]) -> None:
        self._bars_of = bars_of
        self._handle: Any = None

    def __call__(self, status: Any) -> None:
        """Show it."""
        bars = self._bars_of(status)
        content = {"text/html": bars.html(), "text/plain": bars.text()}
        if self._handle is None:
            display = importlib.import_module("IPython.display").display  # there, or this would be no notebook
            self._handle = display(content, raw=True, display_id=True)
        else:
            self._handle.update(content, raw=True)
