"""What scripts and shells rely on: `--json` everywhere, exit codes as they are documented, completion, waits that are
said."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import httpx
import pytest
import typer
from click.testing import Result
from sqlalchemy import Engine
from typer.testing import CliRunner

from armature import Client, client
from armature.cli import server
from armature.cli.commands import app
from armature.cli.exit_codes import ExitCode
from shared.settings import Settings

ROOT = Path(__file__).parents[2]
TABLE_ROW = re.compile(r"^\| (\d+) \| ([^|]+?) \|", re.M)
SHELL_TIMEOUT_S = 120.0


def commands(group: Any, before: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    """Every command with its full name."""
    for name, command in group.commands.items():
        if getattr(command, "commands", None):
            yield from commands(command, (*before, name))
        else:
            yield " ".join((*before, name)), command


COMMANDS = dict(commands(typer.main.get_command(app)))


def run(*arguments: str, **environment: str) -> Result:
    """A command in this process."""
    return CliRunner().invoke(app, list(arguments), env={"ARMATURE_API_KEY": "", **environment})


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_prints_json(name: str) -> None:
    assert any("--json" in parameter.opts for parameter in COMMANDS[name].params)


def test_the_version() -> None:
    done = run("--version")
    assert (done.exit_code, done.stdout) == (0, f"armature {version('armature-codesign')}\n")


def test_exit_codes_are_documented() -> None:
    page = (ROOT / "docs" / "terminal.md").read_text(encoding="utf-8")
    assert {int(code): meaning for code, meaning in TABLE_ROW.findall(page)} == {
        code.value: code.meaning for code in ExitCode
    }
    assert all(f"{code.value} {code.meaning}" in " ".join(run("--help").stdout.split()) for code in ExitCode)


def test_keys_and_migrations_as_json(settings: Settings, engine: Engine) -> None:
    """Standard output holds the JSON alone; what is said beside it goes to standard error."""
    home = {"ARMATURE_DATABASE_URL": settings.database_url, "ARMATURE_HOME": str(settings.home)}

    def answer(*arguments: str) -> Any:
        done = run(*arguments, "--json", **home)
        assert done.exit_code == 0, done.output
        return json.loads(done.stdout)

    assert re.fullmatch(r"\d{4}", answer("migrate")["revision"])
    made = answer("key", "create", "night run")
    assert made["key"].startswith("armature_")
    (listed,) = answer("key", "list")["items"]
    assert (listed["id"], listed["name"], listed["revoked_at"]) == (made["id"], "night run", None)
    assert answer("key", "revoke", "night run") == {"key": "night run", "revoked": 1}
    assert answer("key", "list")["items"][0]["revoked_at"] is not None
    again = run("key", "revoke", "night run", "--json", **home)
    assert (again.exit_code, json.loads(again.stdout)["revoked"]) == (ExitCode.NOT_FOUND, 0)


@pytest.fixture
def answers(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Makes the server of commands give these answers in turn, without any sleeping."""

    def give(*answers: httpx.Response) -> None:
        left = iter(answers)
        transport = httpx.MockTransport(lambda _: next(left))
        monkeypatch.setattr(server, "Client", partial(Client, transport=transport))
        monkeypatch.setattr(client.time, "sleep", lambda _: None)

    return give


def full(wait_s: str) -> httpx.Response:
    """A server whose queue is full."""
    problem = {"detail": "the queue is full: at most 20000 jobs", "errors": [{"field": "tasks", "limit": "at most"}]}
    return httpx.Response(429, json=problem, headers={"Retry-After": wait_s})


def test_a_wait_that_the_server_asks_for_is_said(answers: Callable[..., None]) -> None:
    answers(full("30"), httpx.Response(200, json={"items": [], "next_cursor": None}))
    done = run("list", "--json")
    assert done.exit_code == 0
    assert json.loads(done.stdout)["items"] == []
    assert done.stderr == "waiting 30 s, as the server asks: the queue is full: at most 20000 jobs\n"


def test_the_end_of_patience_is_an_exit_code_of_its_own(answers: Callable[..., None]) -> None:
    answers(full("40"), full("50"))
    done = run("list")
    assert done.exit_code == ExitCode.BUSY
    assert "at most 20000 jobs; it asks to wait 50 s" in done.stderr


def test_a_key_that_is_missing_is_an_exit_code_of_its_own(answers: Callable[..., None]) -> None:
    answers(httpx.Response(401, json={"detail": "this server needs an API key"}))
    done = run("list")
    assert done.exit_code == ExitCode.NO_ACCESS
    assert "ARMATURE_API_KEY" in done.stderr


@pytest.mark.parametrize(
    ("command", "environment", "code", "said"),
    [
        ("migrate", {"ARMATURE_WORKERS": "many"}, 3, "ARMATURE_WORKERS = many: input should be a valid integer"),
        ("migrate", {"ARMATURE_DATABASE_URL": "nonsense"}, 1, "ARMATURE_DATABASE_URL = nonsense: no address such as"),
        (
            "key list",
            {"ARMATURE_DATABASE_URL": "postgresql://me:hidden@127.0.0.1:1/x"},
            1,
            "me:***@127.0.0.1:1/x cannot",
        ),
        ("robot check ur5 --draw /dev/null/arm.svg", {}, 1, "/dev/null/arm.svg: not a directory"),
        ("robot check ur5 --draw arm.xyz", {}, 2, "arm.xyz ends neither in .svg"),
        ("robot check nothing", {}, 3, "no preset of that name; presets are gen3, puma560, ur5"),
        ("submit /", {}, 3, "/ cannot be read"),
        ("list --url nonsense", {}, 5, "no server answers at nonsense"),
        ("watc x", {}, 2, "Did you mean 'watch'"),
    ],
)
def test_what_people_get_wrong_is_said(command: str, environment: dict[str, str], code: int, said: str) -> None:
    """No traceback, and no password."""
    done = run(*command.split(), **environment)
    assert isinstance(done.exception, SystemExit)
    assert done.exit_code == code
    assert said in " ".join(done.stderr.split())
    assert "hidden" not in done.output


def shell(script: str, *arguments: str, **environment: str) -> str:
    """What a script of bash prints; `armature` is the command of this checkout."""
    command = f'armature() {{ "{sys.executable}" -m armature.cli.main "$@"; }}\nexport -f armature\n'
    done = subprocess.run(
        ["bash", "-c", command + script, "bash", *arguments],
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=SHELL_TIMEOUT_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_bash_completes(tmp_path: Path) -> None:
    """The script that `--show-completion` prints, taken in by a real bash, which then is asked what TAB would show."""
    asks = shown_completion("bash") + 'COMP_WORDS=(armature de); COMP_CWORD=1; PATH="$1:$PATH"; unset -f armature\n'
    asks += '_armature_completion armature; echo "${COMPREPLY[@]}"'
    launcher = tmp_path / "armature"
    launcher.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m armature.cli.main "$@"\n')
    launcher.chmod(0o755)
    assert shell(asks, str(tmp_path)).split() == ["design", "designs", "delete"]


def shown_completion(name: str) -> str:
    """The script of any shell: typer asks which one it runs in, unless it is told not to."""
    return shell(f"armature --show-completion {name}", _TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION="1")


@pytest.mark.parametrize("name", ["bash", "zsh", "fish"])
def test_every_shell_has_a_script(name: str) -> None:
    assert f"_ARMATURE_COMPLETE=complete_{name}" in shown_completion(name)


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("armature sweep ca", ["cancel"]),
        ("armature export x --format ros", ["ros-json", "ros-yaml"]),
        ("armature report --loc", ["--local"]),
    ],
)
@pytest.mark.parametrize("name", ["zsh", "fish"])
def test_the_other_shells_are_answered(name: str, typed: str, offered: list[str]) -> None:
    """What their scripts ask the command for."""
    answered = shell(
        "armature",
        _ARMATURE_COMPLETE=f"complete_{name}",
        _TYPER_COMPLETE_ARGS=typed,
        _TYPER_COMPLETE_FISH_ACTION="get-args",
    )
    assert all(word in answered for word in offered), answered
    assert "designs" not in answered
