"""The documentation site builds with every link and anchor right, and shows everything without the network."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

LOADED = re.compile(r'<(?:script|img|iframe|source)[^>]*?\bsrc="(?P<src>[^"]*)"|<link(?P<link>[^>]*)>')
FETCHED_LINKS = ("stylesheet", "icon", "preload", "prefetch", "modulepreload")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built strictly: a warning is an error."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(folder)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_every_page_of_the_repository_is_there(site: Path) -> None:
    for page in (ROOT / "docs").rglob("*.md"):
        assert (site / page.relative_to(ROOT / "docs").with_suffix(".html")).exists(), page
    for name in ("index", "CHANGELOG", "CONTRIBUTING", "LICENSE", "citing", "http", "cli", "client"):
        assert (site / f"{name}.html").exists(), name


def test_nothing_is_fetched_from_elsewhere(site: Path) -> None:
    for page in site.rglob("*.html"):
        for found in LOADED.finditer(page.read_text(encoding="utf-8")):
            attributes = found["link"] or ""
            if attributes and not any(f'rel="{kind}"' in attributes for kind in FETCHED_LINKS):
                continue
            address = re.search(r'href="([^"]*)"', attributes)
            source = found["src"] or (address and address[1]) or ""
            assert "//" not in source, f"{page.name}: {source}"
    for style in site.rglob("*.css"):
        assert not re.search(r"url\(['\"]?(?:https?:)?//", style.read_text(encoding="utf-8")), style


def test_equations_are_drawn(site: Path) -> None:
    page = (site / "model.html").read_text(encoding="utf-8")
    assert page.count("<math") > 50
    assert "\\frac" not in page


def test_reference_pages_hold_what_the_code_holds(site: Path) -> None:
    import armature
    from armature.client import Application

    http = (site / "http.html").read_text(encoding="utf-8")
    assert "POST /v1/applications" in http
    assert "DELETE /v1/robots/{robot_id}" in http
    client = (site / "client.html").read_text(encoding="utf-8")
    for name in armature.__all__:
        assert name in client
    assert f"Application.{Application.trajectory.__name__}" in client
    assert "armature submit" in (site / "cli.html").read_text(encoding="utf-8")
