"""What the fault tests measured, as a table of docs/reliability.md.

`make reliability` does both; after `make test-faults`, `python -m benchmarks.reliability` only writes the table.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence

from benchmarks.tables import ROOT, put, table

PAGE = ROOT / "docs" / "reliability.md"
FIGURES = ROOT / "out" / "faults.json"

EMBEDDED = re.compile(r"embedded|sqlite")
PRODUCTION = re.compile(r"postgres")


def main() -> None:
    """Write the table."""
    figures: dict[str, Sequence[str]] = json.loads(FIGURES.read_text())
    put(
        "figures",
        table(("test", "on", "measured"), [row for test in sorted(figures) for row in _rows(test, figures[test])]),
        PAGE,
    )


def _rows(test: str, figures: Sequence[str]) -> list[tuple[str, str, str]]:
    name, _, variant = test.rstrip("]").partition("[")
    return [(f"`{name}`", _servers(name, variant), figure) for figure in figures]


def _servers(name: str, variant: str) -> str:
    if EMBEDDED.search(variant) or EMBEDDED.search(name):
        return "embedded"
    return "Postgres, Redis" if PRODUCTION.search(variant) or not variant else variant


if __name__ == "__main__":
    main()
