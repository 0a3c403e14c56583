"""A server that asks for keys, in a browser: log in once, follow an application live, log out."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect

from armature.processes import Place, Service, running_service
from services.jobs.keys import create_key, revoke_key
from shared.db.engine import make_engine
from shared.settings import Settings
from tests.conftest import home_with_kernels
from tests.web.browser import Watched
from tests.web.conftest import WAIT_MS, submit

UNAUTHORIZED = "401"


@pytest.fixture
def settings(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Settings:
    """Of a home of its own."""
    return Settings(home=home_with_kernels(tmp_path_factory.mktemp("keys") / "home"))


@pytest.fixture
def service(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> Iterator[Service]:
    """The service, asking for keys."""
    monkeypatch.setenv("ARMATURE_API_KEYS_REQUIRED", "true")
    with running_service(settings, Place(workers=1)) as service:
        yield service


@pytest.fixture
def page(browser: Browser, service: Service, watched: Watched) -> Iterator[Page]:
    """A page of that service."""
    context = browser.new_context(base_url=service.url)
    context.set_default_timeout(WAIT_MS)
    expect.set_options(timeout=WAIT_MS)
    page = context.new_page()
    watched.expected = (UNAUTHORIZED,)
    watched.attach(page)
    yield page
    page.goto("about:blank")
    context.close()
    assert watched.unexpected() == []
    assert watched.elsewhere == []


def test_log_in_follow_and_log_out(page: Page, service: Service, settings: Settings) -> None:
    engine = make_engine(settings.database_url)
    _, key = create_key(engine, "Ada")
    with httpx.Client(base_url=service.url, headers={"Authorization": f"Bearer {key}"}, timeout=30.0) as http:
        application = submit(http, name="mine")
    page.goto(f"/#/applications/{application}")
    expect(page.get_by_role("heading", level=1)).to_have_text("Log in")
    assert [rule["id"] for rule in Axe().run(page).response["violations"]] == []
    page.get_by_label("API key").fill("armature_guess")
    page.keyboard.press("Enter")
    expect(page.get_by_role("alert")).to_contain_text("unknown, or was revoked")

    page.get_by_label("API key").fill(key)
    page.get_by_role("button", name="Log in").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("mine")
    expect(page.locator(".head .state")).to_contain_text("done")  # through the event stream, by its cookie
    assert page.evaluate("document.cookie") == ""
    page.reload()
    expect(page.get_by_role("heading", level=1)).to_have_text("mine")

    page.get_by_role("button", name="Log out").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Log in")
    expect(page.get_by_role("button", name="Log out")).to_be_hidden()
    page.get_by_label("API key").fill(key)
    page.keyboard.press("Enter")
    expect(page.get_by_role("heading", level=1)).to_have_text("mine")
    revoke_key(engine, "Ada")
    page.reload()
    expect(page.get_by_role("heading", level=1)).to_have_text("Log in")
    engine.dispose()
