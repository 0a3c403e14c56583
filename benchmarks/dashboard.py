"""How soon the dashboard is there with 2,000 applications and one of 500 tasks, while two workers solve.

    python -m benchmarks.dashboard [--applications 2000] [--tasks 500]

Times are of Chromium's own clock from the start of the navigation, each on a fresh profile (nothing cached), median of
several. The table goes into docs/performance.md. Needs Chromium (tests/web/browser.py says how to get it).
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import httpx
from playwright.sync_api import Browser, sync_playwright

from armature.processes import Place, running_service
from benchmarks.tables import put, table
from services.codesign.kernels import default_cache
from shared.settings import Settings
from tests.web.browser import ARGUMENTS, HOW_TO_GET_IT, chromium

QUICK = {"scheme": "radau", "degree": 1, "intervals": 20, "control": "voltage"}
ROUNDS = 7
WATCHED_MS = 5000
"""How long a page is left alone to see what its updates cost."""

WHEN = """() => {
  const paint = performance.getEntriesByName("first-contentful-paint")[0];
  return {paint: paint ? paint.startTime : NaN, content: performance.now()};
}"""
LONG_TASKS = """() => {
  window.longTasks = [];
  new PerformanceObserver((list) => window.longTasks.push(...list.getEntries().map((e) => e.duration)))
    .observe({type: "longtask", buffered: true});
}"""


def main() -> None:
    """Fill, measure, write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--applications", type=int, default=2000)
    parser.add_argument("--tasks", type=int, default=500)
    arguments = parser.parse_args()
    path = chromium()
    if path is None:
        raise SystemExit(HOW_TO_GET_IT)
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        default_cache().mkdir(parents=True, exist_ok=True)
        (home / "kernels").symlink_to(default_cache())
        with running_service(Settings(home=home), Place(workers=2)) as service, sync_playwright() as playwright:
            large = fill(service.url, arguments.applications, arguments.tasks)
            first = f"/v1/applications/{large}"
            pages = (
                ("/#/", ".list tbody tr", f"list of {arguments.applications:,}", ["/v1/applications"]),
                ("/#/?name=99", ".list tbody tr", "search in it", ["/v1/applications?name=99"]),
                (f"/#/applications/{large}", ".cell", f"grid of {arguments.tasks} tasks", [first, f"{first}/overview"]),
            )
            browser = playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
            rows = [
                [what, *paints(browser, service.url + place, content), asked(service.url, addresses)]
                for place, content, what, addresses in pages
            ]
            browser.close()
    head = ["page", "first paint", "content", "longest update", "asks the API for"]
    put("dashboard", table(head, rows))


def fill(url: str, applications: int, tasks: int) -> str:
    """One large application first, so that it is being solved; then many small ones."""
    with httpx.Client(base_url=url, timeout=60.0) as http:
        strokes = [round(0.1 + 0.9 * k / (tasks // 5), 4) for k in range(tasks // 5)]
        large = post(http, "large", {"stroke": strokes, "payload_kg": [0, 1, 2, 3, 4]})
        began = time.perf_counter()
        for k in range(applications - 1):
            post(http, f"application {k}", {"stroke": [0.2], "payload_kg": [0]})
        print(f"{applications - 1} submitted in {time.perf_counter() - began:.1f} s", flush=True)
    return large


def asked(url: str, addresses: Sequence[str]) -> str:
    """How long the API takes for what a page asks, and how much that is."""
    took, size = 0.0, 0
    with httpx.Client(base_url=url, timeout=60.0) as http:
        for address in addresses:
            each = []
            for _ in range(ROUNDS):
                began = time.perf_counter()
                answer = http.get(address)
                each.append(time.perf_counter() - began)
            took += statistics.median(each)
            size += len(answer.content)
    return f"{1e3 * took:.0f} ms, {size / 1e3:.0f} kB"


def post(http: httpx.Client, name: str, grid: dict[str, Any]) -> str:
    """Submit a grid."""
    body = {"name": name, "tasks": {"grid": grid}, "transcription": QUICK, "tags": [f"batch-{len(name)}"]}
    answer = http.post("/v1/applications", json=body)
    answer.raise_for_status()
    return str(answer.json()["id"])


def paints(browser: Browser, url: str, content: str) -> tuple[str, str, str]:
    """Open the page anew several times; then leave it open and see how long its updates hold the browser up."""
    painted, contents = [], []
    for _ in range(ROUNDS):
        context = browser.new_context()
        page = context.new_page()
        page.goto(url)
        page.locator(content).first.wait_for()
        found = page.evaluate(WHEN)
        painted.append(found["paint"])
        contents.append(found["content"])
        if len(painted) == ROUNDS:
            page.evaluate(LONG_TASKS)
            page.wait_for_timeout(WATCHED_MS)
            longest = max(page.evaluate("window.longTasks"), default=0.0)
        context.close()
    return ms(statistics.median(painted)), ms(statistics.median(contents)), ms(longest)


def ms(value: float) -> str:
    """A time as it stands in the table."""
    return f"{value:.0f} ms"


if __name__ == "__main__":
    main()
