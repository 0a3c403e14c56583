"""Pages that nobody has put into the navigation come last, so that none is lost; decisions have a part of their own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[1]


def on_config(config: Any) -> Any:
    """Complete the navigation."""
    named = set(_pages(config["nav"]))
    rest = [path.relative_to(DOCS).as_posix() for path in sorted(DOCS.rglob("*.md"))]
    rest = [page for page in rest if page not in named]
    decisions = [page for page in rest if page.startswith("decisions/")]
    config["nav"] += [{"Decisions": decisions}] if decisions else []
    others = [page for page in rest if page not in decisions]
    config["nav"] += [{"More": others}] if others else []
    return config


def _pages(nav: Any) -> Iterator[str]:
    if isinstance(nav, str):
        yield nav
    for part in nav.values() if isinstance(nav, dict) else nav if isinstance(nav, list) else []:
        yield from _pages(part)
