"""`armature up` and the commands that ask a server, all as real processes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from armature.processes import Place, ServiceError, running_service
from shared.settings import Settings
from tests.acceptance.cli import (
    EXAMPLES,
    armature,
    interrupt,
    processes_of,
    quick_copy,
    read_until,
    start,
    wait_until_gone,
)
from tests.conftest import home_with_kernels
from tests.servers import free_port


@dataclass(frozen=True)
class Server:
    """A running `armature up`."""

    process: subprocess.Popen[str]
    home: Path
    url: str

    def ask(self, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        """Run a command against it."""
        return armature(self.home, *arguments, ARMATURE_URL=self.url)

    def ask_json(self, *arguments: str | Path) -> Any:
        """The same with --json."""
        done = self.ask(*arguments, "--json")
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """One server for the commands; ended by Ctrl-C, which has to leave nothing."""
    home = home_with_kernels(tmp_path_factory.mktemp("up") / "home")
    process = start(home, "up", "--port", "0", "--workers", "2")
    line = read_until(process.stdout, "listens on")[-1]
    yield Server(process, home, next(word for word in line.split() if word.startswith("http://")))
    _, said = interrupt(process)
    assert process.returncode == 130, said
    assert processes_of(home) == []


@pytest.fixture(scope="module")
def finished(server: Server, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Id of the five-pose example, submitted and watched to its end."""
    file = quick_copy("five_poses.yaml", tmp_path_factory.mktemp("files"))
    submitted = server.ask("submit", file)
    assert submitted.returncode == 0, submitted.stderr
    application_id = submitted.stdout.strip()
    watched = server.ask("watch", application_id)
    assert watched.returncode == 0, watched.stdout + watched.stderr
    assert "motions      15 of 15" in watched.stdout
    return application_id


def test_tables(server: Server, finished: str) -> None:
    """What a person sees."""
    expected = {
        "status": ["machine-tending", "succeeded", "15 of 15"],
        "tasks": ["reject far away", "succeeded", "worst_case"],
        "design": ["Design (two_step)", "What binds:"],
        "designs": ["Own designs of 5 tasks", "mean of the own designs", "empirical, mm"],
        "comparison": ["Totals over the 5 tasks", "two_step", "worst_case", "regret"],
    }
    for command, texts in expected.items():
        done = server.ask(command, finished)
        assert done.returncode == 0, done.stderr
        for text in texts:
            assert text in done.stdout, command
    assert finished in server.ask("list", "--tag", "cell-3").stdout
    assert finished not in server.ask("list", "--tag", "cell-4").stdout


def test_json(server: Server, finished: str) -> None:
    """What a program sees: the server's answers."""
    assert server.ask_json("status", finished)["state"] == "succeeded"
    assert len(server.ask_json("tasks", finished)["items"]) == 5
    assert server.ask_json("design", finished, "--method", "worst_case")["method"] == "worst_case"
    assert len(server.ask_json("designs", finished)["tasks"]) == 5
    assert set(server.ask_json("comparison", finished)["regret"]) == {"two_step", "empirical", "worst_case"}
    assert [item["id"] for item in server.ask_json("list")["items"]] == [finished]
    assert server.ask_json("watch", finished)["id"] == finished
    assert server.ask_json("cancel", finished)["state"] == "succeeded"  # nothing left to cancel


def test_robots_as_json(server: Server) -> None:
    """Uploaded, listed, shown, and forgotten."""
    robot = server.ask_json("robot", "upload", EXAMPLES / "my_arm.yaml")["id"]
    assert robot in [item["id"] for item in server.ask_json("robot", "list")]
    assert server.ask_json("robot", "show", robot)["gear_ratio"] == [100.0] * 3
    assert server.ask_json("robot", "delete", robot) == {"id": robot, "deleted": True}
    assert robot not in [item["id"] for item in server.ask_json("robot", "list")]


def test_a_server_says_where_it_is_as_json(home: Path) -> None:
    """For whoever starts it from a program."""
    process = start(home, "up", "--json", "--port", "0", "--workers", "1")
    said = json.loads("".join(read_until(process.stdout, "}")))
    assert armature(home, "list", "--url", said["url"]).returncode == 0
    assert (said["workers"], Path(said["logs"]).is_dir()) == (1, True)
    rest, _ = interrupt(process)
    assert (rest, process.returncode) == ("", 130)


@pytest.mark.parametrize("name", ["bash", "zsh", "fish"])
def test_tab_offers_the_ids_that_the_server_has(server: Server, finished: str, name: str) -> None:
    """In bash the words and the place of the cursor, in the others the line."""
    typed = f"armature status {finished[:4]}"
    line = {"COMP_WORDS": typed, "COMP_CWORD": "2"} if name == "bash" else {"_TYPER_COMPLETE_ARGS": typed}
    asked = {"_ARMATURE_COMPLETE": f"complete_{name}", "_TYPER_COMPLETE_FISH_ACTION": "get-args", **line}
    assert finished in armature(server.home, ARMATURE_URL=server.url, **asked).stdout
    nobody = f"http://127.0.0.1:{free_port()}"
    assert finished not in armature(server.home, ARMATURE_URL=nobody, **asked).stdout


def test_what_there_is_not(server: Server, finished: str) -> None:
    missing = server.ask("status", "nothing")
    assert missing.returncode == 4
    assert "there is no application nothing" in missing.stderr
    assert server.ask("design", finished, "--method", "magic").returncode == 3


def test_no_server(home: Path) -> None:
    done = armature(home, "list", "--url", f"http://127.0.0.1:{free_port()}")
    assert done.returncode == 5
    assert "no server answers at http://127.0.0.1:" in done.stderr
    assert "armature up" in done.stderr


def test_a_taken_port(server: Server, home: Path) -> None:
    done = armature(home, "up", "--port", server.url.rsplit(":", 1)[1])
    assert done.returncode == 1
    assert "cannot be used" in done.stderr
    assert processes_of(home) == []


def test_a_process_that_ends_is_reported_with_its_last_words(home: Path) -> None:
    """Everything else is stopped then: half a service helps nobody."""
    with pytest.raises(ServiceError, match=r"the api process ended \(signal 9\)"):  # noqa: PT012, SIM117
        with running_service(Settings(home=home), Place(workers=1)) as service:
            os.kill(service.pids["api"], signal.SIGKILL)
            while True:
                service.check()
    assert wait_until_gone(home, 1.0) == []


def test_a_process_that_cannot_start_says_why(home: Path) -> None:
    settings = Settings(home=home, broker_url="redis://127.0.0.1:1/not-a-number")
    with pytest.raises(ServiceError, match=r"process ended \(exit code \d+\)\n(.*\n)+.*all of it is in"):  # noqa: SIM117
        with running_service(settings, Place(workers=1)):
            pass
