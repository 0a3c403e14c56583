"""Screenshots of the dashboard for docs/dashboard.md, of applications that are solved for them.

    python docs/make_screenshots.py [--home DIR]

Starts the service, submits some of the examples, photographs the page while the largest is being solved, and every
other page when all have ended: some minutes. With `--home` what was solved stays there, and is found the next time.
Needs Chromium (tests/web/browser.py says how to get it).
"""

from __future__ import annotations

import argparse
import io
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from armature import Client
from armature.client import Application
from armature.processes import Place, running_service
from services.codesign.kernels import default_cache
from shared.settings import Settings
from tests.web.browser import ARGUMENTS, HOW_TO_GET_IT, chromium

DOCS = Path(__file__).parent
IMAGES, EXAMPLES = DOCS / "images", DOCS.parent / "examples"
STUDY, CELL = EXAMPLES / "pick_and_place.yaml", EXAMPLES / "five_poses.yaml"
OTHERS = (EXAMPLES / "single_task.yaml", EXAMPLES / "my_arm.yaml")
DESKTOP = {"width": 1280, "height": 860}
PHONE = {"width": 390, "height": 844}
COLOURS = 256
PATIENCE_MS = 300_000
SETTLE_MS = 700
"""For fonts, plots and the view of the arm to be drawn."""
WORKERS = 2
HALF_THE_TASKS = ".cell[data-state=succeeded] >> nth=13"
OUT_OF_REACH = "0.3, 2.5, 0.3, 0.3, 0.3, 0.3"
"""Joint 2 of the arm ends at 1.88 rad."""


def main() -> None:
    """Start the service, solve, photograph."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--home", type=Path, help="folder of the service's database (default: one for this run)")
    home = parser.parse_args().home
    path = chromium()
    if path is None:
        raise SystemExit(HOW_TO_GET_IT)
    with (
        tempfile.TemporaryDirectory() as folder,
        running_service(Settings(home=prepared(home or Path(folder))), Place(workers=WORKERS)) as service,
        Client(service.url) as client,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
        *_, cell, study = (client.submit(file, idempotency_key=file.stem) for file in (*OTHERS, CELL, STUDY))
        live(browser, service.url, study)
        for application in (study, cell):
            application.wait(progress=True)
        at_rest(browser, service.url, study, cell)
        browser.close()


def prepared(home: Path) -> Path:
    """A home that finds the kernels that this machine has compiled already."""
    home.mkdir(parents=True, exist_ok=True)
    default_cache().mkdir(parents=True, exist_ok=True)
    if not (home / "kernels").exists():
        (home / "kernels").symlink_to(default_cache())
    return home


def live(browser: Browser, url: str, study: Application) -> None:
    """While it is being solved: the list and the grid of tasks; nothing once it has ended."""
    if study.status().finished_at is not None:
        print("solved before: dashboard-list.png and dashboard-live.png stay as they are")
        return
    with page_of(browser, url) as page:
        page.goto(f"/#/applications/{study.id}")
        page.locator(HALF_THE_TASKS).wait_for()
        shoot(page, "live")
        page.goto("/#/")
        page.locator(".list tbody tr").first.wait_for()
        shoot(page, "list", height=560)


def at_rest(browser: Browser, url: str, study: Application, cell: Application) -> None:
    """Everything that is shown of what has ended."""
    of_study = f"/#/applications/{study.id}"
    with page_of(browser, url) as page:
        for name, place, height in (
            ("design", f"{of_study}/design", 1000),
            ("task", f"/#/applications/{cell.id}/tasks/0?method=two_step", 1500),
            ("compare", f"/#/compare?a={study.id}&b={cell.id}", 1000),
        ):
            page.goto(place)
            shoot(page, name, height=height)
        page.goto("/#/submit")
        page.get_by_text("list", exact=True).click()
        page.get_by_role("textbox", name="Name").first.fill("two moves")
        page.get_by_label("Start [rad]").nth(1).fill(OUT_OF_REACH)
        page.get_by_role("button", name="Submit", exact=True).click()
        page.get_by_role("alert").first.wait_for()
        shoot(page, "submit", height=900)
    with page_of(browser, url, scheme="dark") as page:
        page.goto(f"{of_study}/comparison")
        shoot(page, "comparison", height=1000)
    with page_of(browser, url, phone=True) as page:
        page.goto(f"{of_study}/design")
        shoot(page, "phone")


@contextmanager
def page_of(browser: Browser, url: str, scheme: str = "light", *, phone: bool = False) -> Iterator[Page]:
    """A page with nothing remembered."""
    context = browser.new_context(
        base_url=url,
        viewport=PHONE if phone else DESKTOP,  # type: ignore[arg-type]
        color_scheme=scheme,  # type: ignore[arg-type]
    )
    context.set_default_timeout(PATIENCE_MS)
    yield context.new_page()
    context.close()


def shoot(page: Page, name: str, height: int | None = None) -> None:
    """Write docs/images/dashboard-NAME.png, in few colours: a third of the bytes, and no difference to be seen."""
    if height is not None:
        page.set_viewport_size({"width": DESKTOP["width"], "height": height})
    page.get_by_role("heading", level=1).wait_for()
    page.wait_for_timeout(SETTLE_MS)
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    path = IMAGES / f"dashboard-{name}.png"
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
