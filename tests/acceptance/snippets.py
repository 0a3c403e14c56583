"""Code blocks of the pages: which there are, and what each language means."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]

FENCE = re.compile(r"(?P<mark><!-- not run: *(?P<reason>[^>]*?) *-->\n)?^```(?P<language>\S*)\n(?P<code>.*?)^```$", re.S | re.M)  # fmt: skip # noqa: E501
RUN = ("python", "sh", "console", "yaml")
SHOWN = ("text", "json", "toml", "ini", "xml", "c", "sql", "promql", "nginx", "dockerfile", "diff", "mermaid")
"""Output, and what other programs read: not run by nature."""


@dataclass(frozen=True)
class Snippet:
    """A block of a page."""

    page: str
    line: int
    language: str
    code: str
    reason: str | None  # why it is not run

    @property
    def place(self) -> str:
        """For messages."""
        return f"{self.page}:{self.line}"


def snippets_in(text: str, page: str) -> Iterator[Snippet]:
    """Blocks in order."""
    for match in FENCE.finditer(text):
        line = text.count("\n", 0, match.start("code")) + 1
        yield Snippet(page, line, match["language"], match["code"], match["reason"])


def by_page() -> dict[str, list[Snippet]]:
    """Every page with blocks."""
    found = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in PAGES}
    pages = {name: list(snippets_in(text, name)) for name, text in found.items()}
    return {name: snippets for name, snippets in pages.items() if snippets}
