"""The report's page: the numbers of the answers, whatever people typed as text, and nothing from elsewhere."""

from __future__ import annotations

import hashlib
import json
import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import pytest
import yaml

from services.report.figures import figures_of
from services.report.html_table import number
from services.report.inline_svg import inline_svg
from services.report.page import Report, report_page, request_hash
from services.report.report_tables import certificate_table, limit_tables, result_table, starts_table, totals_table
from services.report.style import new_figure, style
from services.report.words import limit_words
from shared.contracts.comparisons import SharedDesign
from shared.contracts.motions import StartRun, Starts, StartsEnd
from tests.report import answers as made_up

REQUEST: dict[str, Any] = {"name": "made up <i>", "robot": {"name": "µ-arm"}, "tasks": [{"start_rad": [0.1, 1e-3]}]}
TASKS = [{"name": "<b>a</b>", "start_rad": [0.5, -1.0], "end_rad": [0.0, 0.0], "payload_kg": 0.0, "weight": 2.0}]


class Page(HTMLParser):
    """What a browser would make of a page: ids, addresses, text by tag; complains of tags that do not match."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: Counter[str] = Counter()
        self.references: list[str] = []
        self.open: list[str] = []
        self.tags: Counter[str] = Counter()
        self.text: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        self._attributes(attrs)
        if tag not in ("meta", "link", "br"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        self._attributes(attrs)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)

    def _attributes(self, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name == "id":
                self.ids[value or ""] += 1
            if name in ("href", "xlink:href", "src") and value is not None:
                self.references.append(value)
            self.references += re.findall(r"url\((.*?)\)", value or "")


@pytest.fixture(scope="module")
def text() -> str:
    return report_page(Report(made_up.answers(), TASKS, REQUEST))


@pytest.fixture(scope="module")
def page(text: str) -> Page:
    return Page(text)


def test_it_needs_nothing_else(text: str, page: Page) -> None:
    """No script, and every reference is to something inside the page, which is there once."""
    assert page.tags["script"] == page.tags["img"] == page.tags["iframe"] == 0
    inside = [reference[1:] for reference in page.references if reference.startswith("#")]
    assert len(inside) > 100
    assert all(reference.startswith(("#", "data:")) for reference in page.references)
    assert set(inside) <= set(page.ids)
    assert {name: count for name, count in page.ids.items() if count > 1} == {}
    assert "@import" not in text


def test_all_figures_are_in_it_and_said_in_words(text: str, page: Page) -> None:
    assert page.tags["svg"] == page.tags["figure"] == page.tags["figcaption"] == 5
    assert len(re.findall(r'<svg[^>]*role="img" aria-label="[^"]{20,}"', text)) == 5


def test_the_same_answers_give_the_same_page(text: str) -> None:
    assert report_page(Report(made_up.answers(), TASKS, REQUEST)) == text


def test_what_people_typed_is_text(text: str, page: Page) -> None:
    assert "<b>a</b>" not in text
    assert "<b>a</b>" in page.text
    assert page.tags["b"] == page.tags["i"] == 0


def test_totals_and_regret_are_those_worked_out_by_hand() -> None:
    """Over three tasks: own 1 + 1.5 + 2 = 4.5; two-step 1.1 + 1.6 + 2.2 = 4.9, 8.89 percent more."""
    rows = {row[0]: row for row in totals_table(made_up.comparison()).rows}
    assert rows["own design per task"][1:] == ["4.5", "45", "4.5", "4.5", "–"]
    assert (rows["two-step"][1], rows["two-step"][-1]) == ("4.9", "+8.89")
    assert (rows["worst case"][1], rows["worst case"][-1]) == ("6.23", "+38.44")


def test_limits_are_listed_with_what_they_cost(page: Page) -> None:
    """With the chosen design first; on the page by their units."""
    chosen, own = limit_tables(made_up.comparison(), "two_step")
    assert chosen.rows == [["current_limit_A", "3 A", "raise", "2 of 3 tasks", "0.5 s per A", "0.015"]]
    assert own.rows[1][1:4] == ["differs", "lower", "the design"]
    assert {chosen.caption, own.caption, "0.5 s per A"} <= set(page.text)


def test_the_joint_solve_has_a_figure_of_its_convergence() -> None:
    """Entered far off: the first step does not flatten the rest."""
    points = [[0.0, 900.0], [1.0, 9.0], [2.0, 8.0], [3.0, 7.75], [4.0, 7.7], [5.0, 7.6]]
    found = SharedDesign(design_mm=[made_up.TABLE_I_MM, made_up.SMALL_MM], convergence=points)
    designs = made_up.designs()
    answers = replace(
        made_up.answers(), designs=designs.model_copy(update={"methods": {**designs.methods, "shared_optimum": found}})
    )
    with style():
        (axes,) = dict(figures_of(answers))["convergence"]().axes
        assert [list(point) for point in zip(*axes.lines[0].get_data(), strict=True)] == points
        assert axes.get_ylabel() == "total time [s]"
        low, high = axes.get_ylim()
    assert 7.0 < low < 7.6
    assert 9.0 < high < 10.0
    assert Page(report_page(Report(answers, TASKS, REQUEST))).tags["svg"] == 6


def test_each_task_has_its_row() -> None:
    """Values by method, a dash where a method has no motion, and the regret of the chosen one."""
    table = result_table(made_up.tasks(), ["two_step", "empirical"], "time")
    assert table.rows[1][:7] == ["1", "0.5 rad, 3 kg", "succeeded", "1.5", "1.6", "2", "+6.67"]
    assert table.rows[3][3:7] == ["2.5", "2.5", "–", "0.00"]


def test_several_starts_are_told_with_their_spread() -> None:
    """Of four starts one failed, two ended at 2.0, one at 2.5: a quarter more than the best."""
    assert starts_table(made_up.tasks()) is None
    ends = [StartsEnd(objective=2.0, starts=2), StartsEnd(objective=2.5, starts=1)]
    runs = [
        StartRun(solver_status="-", objective=objective, iterations=1, solve_time_s=0.1)
        for objective in (2.0, 2.0, 2.5, None)
    ]
    found = made_up.tasks()
    own = found.items[1].own
    assert own is not None
    own.starts = Starts(solved=3, ends=ends, runs=runs)
    table = starts_table(found)
    assert table is not None
    assert table.rows == [[made_up.NAMES[1], "own", "3 of 4", "2", "2", "2", "2.5", "+25.00"]]


def test_every_motion_has_its_certificate() -> None:
    rows = certificate_table(made_up.tasks()).rows
    assert len(rows) == 4 * 4 - 1
    assert rows[0][:2] == ["0.5 rad, 0 kg", "own"]
    assert rows[0][5:7] == ["0", "1.0e−09"]


def test_limits_are_said_with_their_value() -> None:
    assert limit_words("h_sy_min", {"limit": 5.0, "unit": "mm"}) == "stator yoke height at least 5 mm"
    assert limit_words("mass", {"limit": 3.0, "unit": "kg"}) == "mass: 3 kg"


def test_numbers_are_read_without_counting_zeros() -> None:
    """Significant digits as asked for, a power of ten only where it is needed."""
    assert [number(value) for value in (None, -1234.56, 176763.0, 2.5e7, 3.57e-6, 0.0)] == [
        "–",
        "−1235",
        "176800",
        "2.5e+07",
        "3.57e−06",
        "0",
    ]


def test_the_request_can_be_taken_out_again(page: Page) -> None:
    """YAML that reads back to the same, whose hash is stated."""
    written = next(text for text in page.text if text.startswith("name: made up"))
    assert yaml.safe_load(written) == REQUEST
    compact = json.dumps(REQUEST, sort_keys=True, separators=(",", ":"))
    assert request_hash(REQUEST) == hashlib.sha256(compact.encode()).hexdigest()
    assert request_hash(REQUEST) in page.text


def test_two_figures_share_no_ids() -> None:
    def drawn(name: str) -> str:
        with style():
            figure = new_figure(2, 2)
            figure.subplots().plot([0, 1], [0, 1])
        return str(inline_svg(figure, name, "a line"))

    first, second = (Page(drawn(name)) for name in ("one", "two"))
    assert set(first.ids).isdisjoint(second.ids)
    assert len(first.ids) == len(second.ids) > 10


def test_an_application_without_results_has_a_page() -> None:
    """Nothing solved yet: no figures, and that is said."""
    nothing = {"design": None, "designs": None, "comparison": None, "motions": (), "robot": None}
    waiting = replace(made_up.answers(), tasks=made_up.tasks().model_copy(update={"items": []}), **nothing)
    page = Page(report_page(Report(waiting, [], REQUEST)))
    assert page.tags["svg"] == 0
    assert "There is no design yet." in page.text
