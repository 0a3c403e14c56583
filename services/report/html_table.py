"""Tables of a report: what is in them, as strings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

NOTHING: Final = "–"
"""Where there is no value."""

PLAIN_BELOW: Final = 1e7
"""Numbers from here on have a power of ten."""


@dataclass(frozen=True)
class HtmlTable:
    """A caption, columns (units under their names after a newline), and rows; the first `left` columns are text."""

    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 1


def number(value: float | None, digits: int = 4) -> str:
    """A number to so many significant digits, with a true minus; a dash where there is none."""
    if value is None:
        return NOTHING
    text = f"{value:.{digits}g}"
    if "e+" in text and abs(value) < PLAIN_BELOW:
        text = f"{float(text):.0f}"
    return text.replace("-", "−")


def small(value: float | None) -> str:
    """An error: 0, or two digits and a power of ten."""
    return NOTHING if value is None else "0" if value == 0 else f"{value:.1e}".replace("-", "−")


def percent(share: float | None) -> str:
    """A share in percent, with its sign."""
    if share is None:
        return NOTHING
    text = f"{100 * share:+.2f}"
    return "0.00" if text in ("+0.00", "-0.00") else text.replace("-", "−")


def vector(values: Sequence[float] | None) -> str:
    """One value a joint."""
    return NOTHING if values is None else ", ".join(number(value) for value in values)
