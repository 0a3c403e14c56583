"""Submit, watch, cancel: what a person does first."""

from __future__ import annotations

import re

import httpx
from playwright.sync_api import Page, Route, expect

from tests.web.browser import Watched
from tests.web.conftest import QUICK, submit

AN_APPLICATION = re.compile(r"#/applications/[0-9a-f]+$")
A_VALUE = re.compile(r"^\d+\.\d+$")


def test_from_the_form_to_the_design(page: Page) -> None:
    """The grid fills while it is looked at, without a reload; then the design is there."""
    page.goto("/#/submit")
    page.get_by_role("textbox", name="Name").fill("from the form")
    page.get_by_label("Strokes [rad]").fill("0.2, 0.4")
    page.get_by_label("Payloads [kg]").fill("0 1")
    page.get_by_text("a grid of mine").click()
    page.get_by_label("Intervals").fill("20")
    page.get_by_label("Tags").fill("form, test")
    page.get_by_role("button", name="Submit").click()

    expect(page).to_have_url(AN_APPLICATION)
    expect(page.get_by_role("heading", level=1)).to_have_text("from the form")
    page.evaluate("window.notReloaded = true")
    cells = page.locator(".grid-table .cell")
    expect(cells).to_have_count(4)
    for k in range(4):
        expect(cells.nth(k)).to_have_text(A_VALUE)
    expect(page.locator(".head .state")).to_contain_text("done")
    expect(page.get_by_role("progressbar", name="Motions")).to_have_attribute("aria-valuenow", "12")
    assert page.evaluate("window.notReloaded")

    page.get_by_role("link", name="Design", exact=True).click()
    motors = page.get_by_role("group", name="Motors, all to one scale").get_by_role("button")
    expect(motors).to_have_count(6)
    motors.nth(2).click()
    expect(page.get_by_role("heading", name="Motor 3")).to_be_visible()
    expect(page.get_by_role("img", name=re.compile("Motor 3, across"))).to_be_visible()
    expect(page.get_by_text("stack length")).to_be_visible()
    page.go_back()
    expect(cells).to_have_count(4)


def test_an_error_stands_at_its_field(page: Page, watched: Watched) -> None:
    """Refused with the field; nothing that was typed is lost; then accepted."""
    watched.expected = ("422",)
    page.goto("/#/submit")
    page.get_by_text("list", exact=True).click()
    page.get_by_role("textbox", name="Name").first.fill("will be refused")
    starts = page.get_by_label("Start [rad]")
    starts.nth(1).fill("0.3, 2.5, 0.3, 0.3, 0.3, 0.3")
    page.get_by_role("button", name="Submit").click()

    expect(page.get_by_role("alert")).to_contain_text("Not submitted")
    expect(starts.nth(1)).to_have_attribute("aria-invalid", "true")
    expect(starts.nth(0)).not_to_have_attribute("aria-invalid", "true")
    at_field = page.locator(".task-row").nth(1).locator(".error:visible")
    expect(at_field).to_contain_text("tasks[1].start_rad[1] = 2.5: joint 2 allows")
    expect(page.get_by_role("textbox", name="Name").first).to_have_value("will be refused")


def test_yaml_is_read_by_the_server_and_errors_lead_to_lines(page: Page, watched: Watched) -> None:
    """What is no YAML, and what is no application, each with its line."""
    watched.expected = ("400", "422")
    page.goto("/#/submit?as=yaml")
    text = page.get_by_label("Application as YAML or JSON")
    good = text.input_value()
    text.fill(good.replace("payload_kg: 2", "payload_kg: -2"))
    page.get_by_role("button", name="Submit").click()
    expect(page.get_by_role("button", name=re.compile(r"line 9: tasks\[0\]\.payload_kg = -2"))).to_be_visible()

    text.fill(good.replace("name: two moves", "name: [two moves"))
    page.get_by_role("button", name="Submit").click()
    expect(page.get_by_role("alert")).to_contain_text("not YAML: line")

    text.fill(good.replace("two moves", "from yaml") + f"transcription: {QUICK}\n")
    page.get_by_role("button", name="Submit").click()
    expect(page).to_have_url(AN_APPLICATION)
    expect(page.get_by_role("row", name=re.compile("pick"))).to_be_visible()


def test_the_form_goes_on_as_yaml(page: Page) -> None:
    """What the form holds is written out in words that the server takes."""
    page.goto("/#/submit")
    page.get_by_role("textbox", name="Name").fill("yes: no")
    page.get_by_role("button", name="Go on as YAML").click()
    text = page.get_by_label("Application as YAML or JSON").input_value()
    assert text.startswith('name: "yes: no"\nrobot: ur5\n')
    assert "    stroke: [0.2, 0.4, 0.6, 0.8, 1]\n" in text


def test_cancel_and_retry(page: Page, http: httpx.Client) -> None:
    """A long one is cancelled from its page, begun again, and cancelled again."""
    application = submit_long(http)
    page.goto(f"/#/applications/{application}")
    state = page.locator(".head .state")
    page.get_by_role("button", name="Cancel").click()
    expect(state).to_contain_text("cancelled")
    page.get_by_role("button", name="Retry failed").click()
    expect(state).to_contain_text(re.compile("queued|running"))
    page.get_by_role("button", name="Cancel").click()
    expect(state).to_contain_text("cancelled")
    page.get_by_role("button", name="Delete").click()
    page.get_by_role("dialog").get_by_role("button", name="Delete it").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Applications")
    assert http.get(f"/v1/applications/{application}").status_code == 404


def test_a_search_is_ended_from_its_page(page: Page, http: httpx.Client) -> None:
    """The button is there while a search runs, which the server is made to say, and asks the server."""
    application = submit_long(http)

    def searching(route: Route) -> None:
        response = route.fetch()
        route.fulfill(response=response, json=response.json() | {"search": "running"})

    page.route(re.compile(rf"/v1/applications/{application}$"), searching)
    page.route("**/stop_search", lambda route: route.fulfill(status=202, json={}))
    page.goto(f"/#/applications/{application}")
    with page.expect_request("**/stop_search") as asked:
        page.get_by_role("button", name="Use best so far").click()
    assert asked.value.method == "POST"
    assert asked.value.url.endswith(f"/v1/applications/{application}/stop_search")
    page.goto("/#/")  # nothing of it is asked for any more
    http.delete(f"/v1/applications/{application}")


def submit_long(http: httpx.Client) -> str:
    """More tasks than a test waits for."""
    strokes = [round(0.1 + 0.02 * k, 2) for k in range(40)]
    return submit(http, name="long one", tasks={"grid": {"stroke": strokes, "payload_kg": [0, 1, 2]}}, compare=[])
