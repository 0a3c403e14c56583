"""Every command, script and YAML on the pages does what the page says it does, against a running service.

A block that cannot run here says why in a comment before it: ``<!-- not run: REASON -->``.
"""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from armature.application_file import read_application, read_robot
from armature.processes import Place, Service, running_service
from shared.settings import Settings
from shared.yaml_document import read_yaml
from tests.acceptance.snippets import ROOT, RUN, SHOWN, Snippet, by_page, snippets_in
from tests.conftest import home_with_kernels

ADDRESS = "http://127.0.0.1:8000"
"""What pages call a server that was started with nothing said."""
PAGE_TIMEOUT_S = 240.0
BASE: dict[str, Any] = {
    "name": "base",
    "robot": "ur5",
    "tasks": [{"name": "lift", "start_rad": [0.2] * 6, "end_rad": [0.0] * 6, "payload_kg": 1, "duration_s": 1.0}],
}
"""What a YAML with some fields of an application is completed by."""

pytestmark = pytest.mark.timeout(PAGE_TIMEOUT_S + 60)


def http_page() -> list[Snippet]:
    """The examples of the HTTP reference, which is made when the site is built."""
    path = ROOT / "docs" / "site" / "http_reference.py"
    spec = importlib.util.spec_from_file_location("http_reference", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return list(snippets_in("\n".join(module.page(module.openapi())), "http.md"))


SNIPPETS = {**by_page(), "http.md": http_page()}


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """The service that the pages speak of."""
    home = home_with_kernels(tmp_path_factory.mktemp("snippets") / "home")
    with running_service(Settings(home=home), Place(workers=2)) as service:
        yield service


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A folder with the examples, and with the commands of `make setup` where pages expect them."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    commands = tmp_path / ".venv" / "bin"
    commands.mkdir(parents=True)
    for name, module in {"armature": "-m armature.cli.main", "python": "", "python3": ""}.items():
        script = commands / name
        script.write_text(f'#!/bin/sh\nexec "{sys.executable}" {module} "$@"\n')
        script.chmod(0o755)
    return tmp_path


@pytest.mark.parametrize("page", SNIPPETS)
def test_every_block_says_its_language_or_why_it_is_not_run(page: str) -> None:
    for snippet in SNIPPETS[page]:
        assert snippet.language in (*RUN, *SHOWN), f"{snippet.place}: a block of language {snippet.language!r}"
        if snippet.reason is not None:
            assert len(snippet.reason.split()) > 2, f"{snippet.place}: {snippet.reason!r} is no reason"


def pages_with(*languages: str) -> list[str]:
    """Pages that have something to run in these languages."""
    return [
        page
        for page, snippets in SNIPPETS.items()
        if any(snippet.language in languages and snippet.reason is None for snippet in snippets)
    ]


def of(page: str, *languages: str) -> list[Snippet]:
    """What is to be run of a page."""
    return [snippet for snippet in SNIPPETS[page] if snippet.language in languages and snippet.reason is None]


@pytest.mark.parametrize("page", pages_with("sh", "console", "python"))
def test_commands_and_scripts_run(page: str, service: Service, clone: Path) -> None:
    """A page's blocks in one shell, one after the other, as a reader would."""
    lines = ["set -euo pipefail"]
    for snippet in of(page, "sh", "console", "python"):
        code = snippet.code.replace(ADDRESS, service.url)
        lines.append(f"echo '--- {snippet.place}' >&2")
        if snippet.language == "python":
            lines.append(f"python - <<'END_OF_SCRIPT'\n{code}\nEND_OF_SCRIPT")
        elif snippet.language == "console":
            lines.append("\n".join(line[2:] for line in code.splitlines() if line.startswith("$ ")))
        else:
            lines.append(code)
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("ARMATURE_")}
    environment = {
        **inherited,
        "PATH": f"{clone / '.venv' / 'bin'}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
        "ARMATURE_URL": service.url,
        "ARMATURE_HOME": str(service.logs.parent),
    }
    done = subprocess.run(
        ["bash", "-c", "\n".join(lines)],
        cwd=clone, env=environment, capture_output=True, text=True, timeout=PAGE_TIMEOUT_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{done.stdout[-2000:]}\n{done.stderr[-3000:]}"


@pytest.mark.parametrize("page", pages_with("yaml"))
def test_yaml_is_accepted(page: str, service: Service, clone: Path) -> None:
    """A robot, an application, or fields of one; a file that it names lies in examples/."""
    (clone / "examples").unlink()
    for urdf in (ROOT / "examples").glob("*.urdf"):
        (clone / urdf.name).symlink_to(urdf)
    path = clone / "snippet.yaml"
    for snippet in of(page, "yaml"):
        content = read_yaml(snippet.code)
        path.write_text(snippet.code)
        if isinstance(content, dict) and set(content) == {"robot"} and isinstance(content["robot"], dict):
            answer = httpx.post(f"{service.url}/v1/robots", json=read_robot(path))
            assert answer.status_code == 201, f"{snippet.place}: {answer.text}"
            continue
        answer = httpx.post(f"{service.url}/v1/applications", json=BASE | read_application(path))
        assert answer.status_code == 202, f"{snippet.place}: {answer.text}"
        httpx.post(f"{service.url}{answer.headers['location']}/cancel").raise_for_status()


def test_a_block_that_fails_is_seen(service: Service, clone: Path) -> None:
    """The tests above can fail."""
    text = "```sh\narmature status nothing\n```\n"
    (snippet,) = snippets_in(text, "page.md")
    SNIPPETS["page.md"] = [snippet]
    try:
        with pytest.raises(AssertionError, match="there is no application nothing"):
            test_commands_and_scripts_run("page.md", service, clone)
    finally:
        del SNIPPETS["page.md"]


def test_addresses_are_those_that_are_replaced() -> None:
    for snippets in SNIPPETS.values():
        for snippet in snippets:
            if snippet.language in ("sh", "console", "python") and snippet.reason is None:
                assert not re.search(r"localhost|127\.0\.0\.1:(?!8000)", snippet.code), snippet.place
