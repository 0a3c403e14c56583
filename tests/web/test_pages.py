"""Every page: what it shows, by mouse and keyboard, and what a checker of accessibility says of it."""

from __future__ import annotations

import re

import httpx
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from tests.web.browser import Watched
from tests.web.conftest import submit

SERIOUS = ("serious", "critical")
PAGES = {
    "list": "/#/",
    "application": "/#/applications/{id}",
    "design": "/#/applications/{id}/design",
    "designs": "/#/applications/{id}/designs",
    "shared optimum": "/#/applications/{shared}/designs",
    "comparison": "/#/applications/{id}/comparison",
    "task": "/#/applications/{id}/tasks/1",
    "compare": "/#/compare?a={id}&b={id}",
    "form": "/#/submit",
    "yaml": "/#/submit?as=yaml",
}
PHONE = {"width": 390, "height": 844}


@pytest.mark.parametrize("name", PAGES)
def test_accessible_in_light_and_dark_and_on_a_phone(page: Page, finished: str, shared_optimum: str, name: str) -> None:
    """axe-core finds nothing serious; on a phone nothing sticks out of the page."""
    page.goto(PAGES[name].format(id=finished, shared=shared_optimum))
    expect(page.get_by_role("heading", level=1)).to_be_visible()
    for scheme, rules in (("light", {}), ("dark", {"runOnly": ["color-contrast"]})):
        page.emulate_media(color_scheme=scheme)
        found = Axe().run(page, options=rules).response["violations"]
        assert [
            (rule["id"], node["target"], node.get("failureSummary"))
            for rule in found
            if rule["impact"] in SERIOUS
            for node in rule["nodes"]
        ] == []
    page.set_viewport_size(PHONE)
    page.wait_for_timeout(100)
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]


def test_scrub_a_motion(page: Page, finished: str) -> None:
    """Time, arm and curves move together; play goes on from there."""
    page.goto(f"/#/applications/{finished}/tasks/3?method=own")
    slider = page.get_by_role("slider", name="Time in the motion")
    arm = page.get_by_role("img", name=re.compile("^The arm in motion"))
    readout = page.locator(".motion-grid .readout").first
    expect(readout).to_have_text("0.400")
    before = arm.evaluate("canvas => canvas.toDataURL()")

    slider.focus()
    page.keyboard.press("End")
    expect(readout).to_have_text("0.000")
    after = arm.evaluate("canvas => canvas.toDataURL()")
    assert before != after
    expect(page.locator(".motion-grid svg")).to_have_count(30)
    expect(page.locator(".motion-grid .limit").first).to_be_attached()

    page.get_by_role("button", name="Play").click()
    expect(page.get_by_role("button", name="Pause")).to_be_visible()
    expect(page.locator(".player output")).to_have_text(re.compile(r"^0\.0[1-9]"))
    page.get_by_role("button", name="Pause").click()

    page.get_by_role("group", name="Joint").get_by_text("2", exact=True).click()
    expect(page.locator(".motion-grid svg")).to_have_count(5)
    arm.focus()
    turned_from = arm.evaluate("canvas => canvas.toDataURL()")
    page.keyboard.press("ArrowLeft")
    assert arm.evaluate("canvas => canvas.toDataURL()") != turned_from
    expect(page.get_by_text("Replay to the end position")).to_be_visible()


def test_comparison_and_designs(page: Page, finished: str) -> None:
    """Totals with regret, heat maps with numbers, a box plot for each of the seven lengths."""
    page.goto(f"/#/applications/{finished}/comparison")
    row = page.get_by_role("row", name=re.compile("^two-step chosen"))
    expect(row).to_contain_text(re.compile(r"[+−]?\d+\.\d %"))
    heat = page.get_by_role("table", name="over worst case")
    expect(heat.locator(".cell")).to_have_count(4)
    expect(heat.locator(".cell").first).to_have_text(re.compile(r"^[+−]?\d+\.\d$"))
    limits = page.get_by_role("table", name="own design per task")
    current = re.compile(r"^current_limit_A 3.A raise \d of 4 tasks .* s.A")
    expect(limits.get_by_role("row", name=current)).to_be_visible()
    page.get_by_role("link", name="Designs", exact=True).click()
    expect(page.locator(".panels svg")).to_have_count(7)
    expect(page.locator(".panels .mark.chosen")).to_have_count(42)


def test_how_the_shared_optimum_was_found(page: Page, shared_optimum: str, http: httpx.Client) -> None:
    """The curve has a point an iteration, and ends where the comparison's total is."""
    page.goto(f"/#/applications/{shared_optimum}/designs")
    found = http.get(f"/v1/applications/{shared_optimum}/designs").json()["methods"]["shared_optimum"]
    total = http.get(f"/v1/applications/{shared_optimum}/comparison").json()["methods"]["shared_optimum"]
    assert found["convergence"][-1][1] == pytest.approx(total["weighted_objective"], rel=1e-3)
    last, value = found["convergence"][-1]
    plot = page.get_by_role("img", name=re.compile(f"to {float(f'{value:.4g}'):g}.s at iteration {last:g}$"))
    expect(plot).to_be_visible()
    assert len((plot.locator(".curve").get_attribute("points") or "").split()) == len(found["convergence"])
    expect(page.locator(".card", has=plot)).to_contain_text(re.compile(f"Iterations{found['iterations']}"))


def test_the_list_is_searched_and_many_are_deleted_together(page: Page, http: httpx.Client) -> None:
    """Filters are addresses: back undoes them."""
    for k in range(2):
        submit(http, name=f"throw away {k}", tags=["waste"], tasks={"grid": {"stroke": [0.2], "payload_kg": [0]}})
    page.goto("/#/")
    page.get_by_label("Name contains").fill("THROW")
    page.get_by_role("button", name="Search").click()
    rows = page.locator(".list tbody tr")
    expect(rows).to_have_count(2)
    page.get_by_role("checkbox", name="Pick all on this page").check()
    page.get_by_role("button", name="Delete 2").click()
    page.get_by_role("dialog").get_by_role("button", name="Delete 2").click()
    expect(page.get_by_text("No application matches.")).to_be_visible()
    page.go_back()
    expect(page.get_by_label("Name contains")).to_have_value("")
    page.get_by_label("State").select_option("cancelled")
    expect(page).to_have_url(re.compile("state=cancelled"))


def test_what_people_typed_is_text(page: Page, http: httpx.Client) -> None:
    """Markup in names and tags is shown as it was typed."""
    name = "<img src=x onerror=alert(1)>\"'&"
    application = submit(
        http,
        name=name,
        tags=["<b>tag</b>"],
        tasks=[{"name": "<script>alert(2)</script>", "start_rad": [0.2] * 6, "end_rad": [0.0] * 6}],
        compare=[],
    )
    page.on("dialog", lambda dialog: pytest.fail(f"a script ran: {dialog.message}"))
    page.goto("/#/")
    expect(page.get_by_role("link", name=name)).to_be_visible()
    expect(page.get_by_role("link", name="<b>tag</b>").first).to_be_visible()
    page.goto(f"/#/applications/{application}")
    expect(page.get_by_role("heading", level=1)).to_have_text(name)
    expect(page.get_by_role("cell", name="<script>alert(2)</script>", exact=True)).to_be_visible()
    assert page.locator("main img, main script").count() == 0


def test_by_keyboard(page: Page, finished: str) -> None:
    """Skip link first; the theme is kept; a page that is new takes the focus."""
    page.goto("/#/")
    expect(page.get_by_role("link", name="finished grid")).to_be_visible()
    page.keyboard.press("Tab")
    expect(page.get_by_role("link", name="Skip to content")).to_be_focused()
    page.keyboard.press("Enter")
    expect(page.locator("main")).to_be_focused()

    theme = page.get_by_role("button", name=re.compile("^Theme"))
    theme.focus()
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    expect(page.locator("html")).to_have_attribute("data-theme", "dark")
    page.reload()
    expect(page.locator("html")).to_have_attribute("data-theme", "dark")

    page.get_by_role("link", name="finished grid").focus()
    page.keyboard.press("Enter")
    expect(page.get_by_role("heading", level=1)).to_have_text("finished grid")
    expect(page.locator("main")).to_be_focused()
    expect(page.locator("#announcements")).to_have_text("finished grid")


def test_what_is_not_there_says_so(page: Page, watched: Watched) -> None:
    """In the server's words, on a page that still leads somewhere."""
    watched.expected = ("404",)
    page.goto("/#/applications/nothing")
    expect(page.get_by_role("alert")).to_have_text("there is no application nothing")
    page.goto("/#/nowhere")
    expect(page.get_by_role("alert")).to_have_text("There is no such page.")
    page.get_by_role("link", name="Applications").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Applications")
