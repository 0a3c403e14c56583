"""The report in a real browser, from a file and with the network off."""

from __future__ import annotations

from pathlib import Path

import httpx
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect

from tests.web.browser import Watched
from tests.web.test_pages import PHONE, SERIOUS


@pytest.fixture(scope="module")
def report(http: httpx.Client, finished: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of an application, kept as a file."""
    answer = http.get(f"/v1/applications/{finished}/report", timeout=120.0).raise_for_status()
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert answer.headers["content-disposition"] == f'inline; filename="finished-grid-{finished}.html"'
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_bytes(answer.content)
    return path


def test_it_opens_with_the_network_off(browser: Browser, report: Path, watched: Watched) -> None:
    """Asks for nothing, complains of nothing; axe-core finds nothing serious; a phone shows all of it."""
    context = browser.new_context(offline=True, viewport={"width": 1280, "height": 900})
    page = context.new_page()
    watched.attach(page)
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(report.as_uri())
    expect(page.get_by_role("heading", level=1)).to_have_text("finished grid")
    assert page.locator("figure svg").count() == 5
    assert all(box is not None and box["width"] > 400 for box in [svg.bounding_box() for svg in page.locator("figure svg").all()])  # fmt: skip # noqa: E501
    page.get_by_text("The request", exact=True).click()
    expect(page.locator("#request")).to_contain_text("stroke:")
    violations = Axe().run(page).response["violations"]
    found = [(rule["id"], node["target"]) for rule in violations if rule["impact"] in SERIOUS for node in rule["nodes"]]
    assert found == []
    page.set_viewport_size(PHONE)
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    context.close()
    assert watched.unexpected() == []
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []


def test_the_dashboard_leads_to_it(page: Page, finished: str) -> None:
    page.goto(f"/#/applications/{finished}")
    page.get_by_role("link", name="Report", exact=True).click()
    page.wait_for_url(f"**/v1/applications/{finished}/report")
    expect(page).to_have_title("finished grid: report")
    expect(page.get_by_role("heading", name="What binds")).to_be_visible()
