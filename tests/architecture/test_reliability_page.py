"""docs/reliability.md names every fault test, and only tests that exist."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reliability.md"


def defined_in(folder: Path) -> set[str]:
    """Names of all test functions under a folder."""
    found: set[str] = set()
    for path in folder.rglob("test_*.py"):
        nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        found |= {node.name for node in nodes if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")}
    return found


def promises() -> set[str]:
    """Tests named in the part of the page that people write."""
    written, _, _ = PAGE.read_text(encoding="utf-8").partition("<!-- figures -->")
    return set(re.findall(r"`(test_\w+)`", written))


def test_every_fault_test_is_on_the_page() -> None:
    assert defined_in(ROOT / "tests" / "faults") - promises() == set()


def test_every_test_on_the_page_exists() -> None:
    assert promises() - defined_in(ROOT / "tests") == set()
