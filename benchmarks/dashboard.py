"""How soon the dashboard is there with 2,000 applications and one of 500 tasks, while two workers solve.

    python -m benchmarks.dashboard [--applications 2000] [--tasks 500]

Times are of Chromium's own clock from the start of the navigation, each on a fresh profile (nothing cached), median of
several. Needs Chromium (tests/web/browser.py says how to get it).
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import httpx
from playwright.sync_api import Browser, sync_playwright

from armature.processes import Place, running_service
from services.codesign.kernels import default_cache
from shared.settings import Settings
from tests.web.browser import ARGUMENTS, HOW_TO_GET_IT, chromium

QUICK = {"scheme": "radau", "degree": 1, "intervals": 20, "control": "voltage"}
ROUNDS = 5
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
    """Fill, measure, print."""
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
            browser = playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
            measure(browser, f"{service.url}/#/", ".list tbody tr", f"list of {arguments.applications}")
            measure(browser, f"{service.url}/#/?name=99", ".list tbody tr", "search in it")
            measure(browser, f"{service.url}/#/applications/{large}", ".grid-table .cell", f"{arguments.tasks} tasks")
            browser.close()


def fill(url: str, applications: int, tasks: int) -> str:
    """One large application first, so that it is being solved; then many small ones."""
    with httpx.Client(base_url=url, timeout=60.0) as http:
        strokes = [round(0.1 + 0.9 * k / (tasks // 5), 4) for k in range(tasks // 5)]
        large = post(http, "large", {"stroke": strokes, "payload_kg": [0, 1, 2, 3, 4]})
        began = time.perf_counter()
        for k in range(applications - 1):
            post(http, f"application {k}", {"stroke": [0.2], "payload_kg": [0]})
        print(f"{applications - 1} submitted in {time.perf_counter() - began:.1f} s")
        for rest in ("/v1/applications", f"/v1/applications/{large}", f"/v1/applications/{large}/overview"):
            took = []
            for _ in range(ROUNDS):
                began = time.perf_counter()
                size = len(http.get(rest).content)
                took.append(time.perf_counter() - began)
            print(f"GET {rest}: {1e3 * statistics.median(took):.0f} ms, {size / 1e3:.0f} kB")
    return large


def post(http: httpx.Client, name: str, grid: dict[str, Any]) -> str:
    """Submit a grid."""
    body = {"name": name, "tasks": {"grid": grid}, "transcription": QUICK, "tags": [f"batch-{len(name)}"]}
    answer = http.post("/v1/applications", json=body)
    answer.raise_for_status()
    return str(answer.json()["id"])


def measure(browser: Browser, url: str, content: str, what: str) -> None:
    """Open the page anew several times; then leave it open and see how long its updates hold the browser up."""
    paints, contents = [], []
    for _ in range(ROUNDS):
        context = browser.new_context()
        page = context.new_page()
        page.goto(url)
        page.locator(content).first.wait_for()
        found = page.evaluate(WHEN)
        paints.append(found["paint"])
        contents.append(found["content"])
        if len(paints) == ROUNDS:
            page.evaluate(LONG_TASKS)
            page.wait_for_timeout(WATCHED_MS)
            longest = max(page.evaluate("window.longTasks"), default=0.0)
        context.close()
    paint, there = statistics.median(paints), statistics.median(contents)
    print(f"{what}: first paint {paint:.0f} ms, content {there:.0f} ms, longest task later {longest:.0f} ms")


if __name__ == "__main__":
    main()
