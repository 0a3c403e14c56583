"""The map from equation to function to test in services/codesign/README.md agrees with the code, both ways."""

from __future__ import annotations

import ast
import importlib
import io
import re
import tokenize
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CODESIGN = ROOT / "services" / "codesign"
MODEL = ROOT / "docs" / "model.md"

EQUATIONS = {"1", "2a", "2b", "2c", "2d", "2e", "3a", "3b", "3c", "4", "5a", "5b", "5c", "6"}
"""Numbered equations of the paper; 1, 4 and 6 are named without their parts."""

_RANGE = re.compile(r"\((\d)([a-e])\)-\((\d)([a-e])\)")
_PLAIN = re.compile(r"\b[Ee]qs?\. \(?(\d[a-e]?)\)?(?:(?:, | and )\(?(\d[a-e]?)\)?)*")
_OTHERS = re.compile(
    r"Algorithm \d|Problem \d|Table I\b|MODEL section \d|[Dd]eparture \d+|"
    r"[Aa]ppendix, (?:Dimensional specifications|Stator and rotor weight|Resistance|Flux|Permeance|Inductance)"
)
_ELSEWHERE = re.compile(r"\b(?:19|20)\d\d, [Ee]qs?\. \(?\d+\)?")
"""Equations of other works are cited after a year."""


def words_of(source: str) -> str:
    """Comments and docstrings of a module."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    comments = [token.string for token in tokens if token.type == tokenize.COMMENT]
    strings = [
        node.value.value
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    ]
    return "\n".join(re.sub(r"\s*\n\s*", " ", text) for text in [*comments, *strings])


def tags_in(text: str) -> set[str]:
    """Every equation, algorithm, problem, table, appendix part, model section and departure that a text names."""
    text = _ELSEWHERE.sub("", text)
    tags = {
        match.group().replace("appendix", "Appendix").replace("departure", "Departure")
        for match in _OTHERS.finditer(text)
    }
    for first, a, last, b in _RANGE.findall(text):
        numbers = [f"{n}{letter}" for n in range(int(first), int(last) + 1) for letter in "abcde"]
        inside = numbers[numbers.index(first + a) : numbers.index(last + b) + 1]
        tags |= set(inside) & EQUATIONS
    tags |= set(re.findall(r"\((\d[a-e])\)", text))
    for match in _PLAIN.finditer(text):
        tags |= set(re.findall(r"\d[a-e]?", match.group()))
    return tags


@cache
def code() -> dict[str, set[str]]:
    """Tags by module name."""
    return {path.stem: tags_in(words_of(path.read_text())) for path in sorted(CODESIGN.glob("*.py"))}


@cache
def rows() -> dict[str, tuple[list[str], list[str]]]:
    """Tag -> (functions, tests) of the README's tables."""
    found = {}
    for line in (CODESIGN / "README.md").read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| ") and len(cells) == 4 and cells[0] not in ("Equation", "Section", "Departure"):
            found[cells[0]] = (re.findall(r"`([^`]+)`", cells[2]), re.findall(r"`([^`]+)`", cells[3]))
    return found


def test_tags_are_read_as_people_read_them():
    assert tags_in("Bounds (2b)-(2e) and (3c)  (eqs. 1 and 4; Section III-B).") == {
        "2b", "2c", "2d", "2e", "3c", "1", "4",
    }  # fmt: skip
    assert tags_in("s_max of Waechter & Biegler 2006, eq. (6).") == set()
    assert tags_in("(5a)-(5c), Problem 2, departure 7, Eq. (4), appendix, Flux") == {
        "5a", "5b", "5c", "Problem 2", "Departure 7", "4", "Appendix, Flux",
    }  # fmt: skip
    assert tags_in("shape (6,), 0.4 * (3 + 2)") == set()


def test_every_tag_in_the_code_is_in_the_table():
    missing = {module: sorted(tags - set(rows())) for module, tags in code().items() if tags - set(rows())}
    assert missing == {}


def test_every_row_is_named_by_a_module_it_lists():
    silent = []
    for tag, (functions, _) in rows().items():
        modules = {name.split(".")[0] for name in functions}
        if not any(tag in code().get(module, set()) for module in modules):
            silent.append((tag, sorted(modules)))
    assert silent == []


def test_every_equation_of_the_paper_has_a_row():
    assert set(rows()) >= EQUATIONS | {"Algorithm 1", "Problem 1", "Problem 2"}


def test_every_row_has_functions_and_tests():
    assert [tag for tag, (functions, tests) in rows().items() if not functions or not tests] == []


@pytest.mark.parametrize("name", sorted({name for functions, _ in rows().values() for name in functions}))
def test_named_functions_exist(name):
    module, *attributes = name.split(".")
    value = importlib.import_module(f"services.codesign.{module}")
    for attribute in attributes:
        fields = getattr(value, "__dataclass_fields__", {})
        if attribute in fields:
            return
        value = getattr(value, attribute)


@pytest.mark.parametrize("name", sorted({name for _, tests in rows().values() for name in tests}))
def test_named_tests_exist(name):
    file, function = name.split(".")
    (path,) = (ROOT / "tests").glob(f"*/{file}.py")
    defined = [node.name for node in ast.parse(path.read_text()).body if isinstance(node, ast.FunctionDef)]
    assert function in defined


def test_sections_and_departures_of_the_model_page_are_those_of_the_table():
    headings = re.findall(r"^#+ (.*)$", MODEL.read_text(), re.MULTILINE)
    sections = {f"MODEL section {heading[0]}" for heading in headings if re.match(r"\d\. ", heading)}
    departures = {match.group() for heading in headings if (match := re.match(r"Departure \d+", heading))}
    assert {tag for tag in rows() if tag.startswith("MODEL")} == sections
    assert {tag for tag in rows() if tag.startswith("Departure")} == departures


def test_the_page_of_the_model_is_named_beside_every_departure():
    for path in CODESIGN.glob("*.py"):
        text = words_of(path.read_text())
        for match in re.finditer(r"[Dd]eparture \d+", text):
            assert text[match.end() :].lstrip().startswith("(docs/model.md)"), f"{path.name}: {match.group()}"
