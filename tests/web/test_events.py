"""Following events over connections that break, against a server that breaks them."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from playwright.sync_api import Browser

from api.dashboard import STATIC
from tests.web.browser import LOOPBACK

ONE_EVENT = "retry: 20\nid: {number}\nevent: job\ndata: {{}}\n\n"
THE_LAST = 'id: {number}\nevent: application\ndata: {{"state": "succeeded"}}\n\n'
FIRST_ASKED = 7
"""Number of the latest event that the page knows."""

FOLLOW = """(after) => import("/dashboard/js/live.js").then(({follow}) => {
  window.heard = [];
  follow("some", after, (kind, content) => window.heard.push(kind), new AbortController().signal);
})"""


class Breaking(ThreadingHTTPServer):
    """Ends each stream after one event; serves the dashboard's scripts besides."""

    def __init__(self) -> None:
        super().__init__((LOOPBACK, 0), _Handler)
        self.asked: list[tuple[str, str | None]] = []


class _Handler(BaseHTTPRequestHandler):
    server: Breaking

    def do_GET(self) -> None:
        if self.path.startswith("/dashboard/"):
            self._answer(
                "text/javascript", (STATIC / self.path.removeprefix("/dashboard/")).read_text(encoding="utf-8")
            )
        elif "/events" in self.path:
            self.server.asked.append((self.path.partition("?")[2], self.headers.get("last-event-id")))
            number = FIRST_ASKED + len(self.server.asked)
            event = ONE_EVENT if len(self.server.asked) < 3 else THE_LAST
            self._answer("text/event-stream", event.format(number=number))
        else:
            self._answer("text/html", "<!doctype html><title>events</title>")

    def _answer(self, kind: str, text: str) -> None:
        self.send_response(200)
        self.send_header("content-type", kind)
        self.end_headers()
        self.wfile.write(text.encode())

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""


@pytest.fixture
def breaking() -> Iterator[Breaking]:
    """The server, answering."""
    with Breaking() as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def test_a_stream_is_taken_up_after_its_last_event(browser: Browser, breaking: Breaking) -> None:
    """Asked again with the number of the last event each time; not asked again once the application has ended."""
    page = browser.new_page()
    page.goto(f"http://{LOOPBACK}:{breaking.server_port}/")
    page.evaluate(FOLLOW, FIRST_ASKED)
    for _ in range(100):
        if "application" in page.evaluate("() => window.heard"):
            break
        page.wait_for_timeout(50)
    page.wait_for_timeout(200)
    heard = page.evaluate("() => window.heard")
    page.close()
    assert heard == ["job", "job", "application"]
    assert breaking.asked == [("after=7", None), ("after=7", "8"), ("after=7", "9")]
