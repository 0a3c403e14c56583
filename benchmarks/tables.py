"""Tables and sections of pages, written by the benchmarks between markers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "performance.md"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; every column but the first to the right."""
    rule = ["---", *["---:"] * (len(head) - 1)]
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, rule, *rows))


def put(section: str, text: str, path: Path = PAGE) -> None:
    """Print a section, and replace what a page has between its markers."""
    print(text, flush=True)
    path.write_text(with_section(path.read_text(), section, text))


def with_section(content: str, section: str, text: str) -> str:
    """A page's content with what is between a section's markers replaced."""
    begin, end = f"<!-- {section} -->", f"<!-- /{section} -->"
    before, rest = content.split(begin)
    _, after = rest.split(end)
    return f"{before}{begin}\n\n{text}\n\n{end}{after}"
