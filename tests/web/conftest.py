"""A running service and a fresh browser page for each test."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from playwright.sync_api import Browser, Page, expect, sync_playwright

from armature.processes import Place, Service, running_service
from shared.settings import Settings
from tests.conftest import home_with_kernels
from tests.web.browser import ARGUMENTS, HOW_TO_GET_IT, Watched, chromium

QUICK = {"scheme": "radau", "degree": 1, "intervals": 20, "control": "voltage"}
"""A coarse grid: nothing here depends on accuracy."""
WAIT_MS = 90_000
FINISH_TIMEOUT_S = 180.0


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """One headless Chromium with a fresh profile."""
    path = chromium()
    if path is None:
        pytest.skip(HOW_TO_GET_IT)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def service(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """The service, running; not started where there is no browser."""
    home = home_with_kernels(tmp_path_factory.mktemp("web") / "home")
    with running_service(Settings(home=home), Place(workers=1)) as service:
        yield service


@pytest.fixture(scope="session")
def http(service: Service) -> Iterator[httpx.Client]:
    """A client of it."""
    with httpx.Client(base_url=service.url, timeout=30.0) as client:
        yield client


def submit(http: httpx.Client, **changes: Any) -> str:
    """Submit a small grid with some fields replaced; returns its id."""
    body = {
        "name": "small grid",
        "tasks": {"grid": {"stroke": [0.2, 0.4], "payload_kg": [0, 1]}},
        "compare": ["empirical", "worst_case"],
        "transcription": QUICK,
        **changes,
    }
    answer = http.post("/v1/applications", json=body)
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


@pytest.fixture(scope="session")
def finished(http: httpx.Client) -> str:
    """Id of an application that has ended well."""
    return ended(http, submit(http, name="finished grid", tags=["shown"]))


@pytest.fixture(scope="session")
def shared_optimum(http: httpx.Client) -> str:
    """Id of one whose design is the best for both of its tasks."""
    grid = {"grid": {"stroke": [0.2, 0.4], "payload_kg": [1]}}
    return ended(http, submit(http, name="shared", tasks=grid, method="shared_optimum", compare=["two_step"]))


def ended(http: httpx.Client, application: str) -> str:
    """The application's id, when it has ended well."""
    deadline = time.monotonic() + FINISH_TIMEOUT_S
    while time.monotonic() < deadline:
        state = http.get(f"/v1/applications/{application}").json()["state"]
        if state == "succeeded":
            return application
        assert state in ("queued", "running")
        time.sleep(0.1)
    raise AssertionError(f"not finished after {FINISH_TIMEOUT_S:g} s")


@pytest.fixture
def watched() -> Watched:
    """What the page complains about."""
    return Watched()


@pytest.fixture
def page(browser: Browser, service: Service, watched: Watched) -> Iterator[Page]:
    """A page with nothing remembered; at the end it must have complained of nothing and asked nobody else."""
    context = browser.new_context(base_url=service.url, viewport={"width": 1280, "height": 900})
    context.set_default_timeout(WAIT_MS)
    expect.set_options(timeout=WAIT_MS)
    page = context.new_page()
    watched.attach(page)
    yield page
    page.goto("about:blank")  # ends its streams
    context.close()
    assert watched.unexpected() == []
    assert watched.elsewhere == []
