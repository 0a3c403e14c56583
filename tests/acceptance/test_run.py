"""`armature run`: from a file to a design, and nothing left behind, however it ends."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from pathlib import Path

import pytest
from sqlalchemy import inspect, select

from shared.db.engine import make_engine, reading
from shared.db.tables import Application
from shared.settings import Settings
from tests.acceptance.cli import (
    EXAMPLES,
    QUICK,
    armature,
    interrupt,
    processes_of,
    quick_copy,
    read_until,
    start,
    wait_until_gone,
)

PAPER = EXAMPLES / "pick_and_place.yaml"
RUNNING = "0 of 25"
"""What `run` says once jobs of the paper's application run."""

LONGEST_LIFE_AFTER_KILL_S = 15.0
"""The drain and what is added before a kill, and then some for a busy machine."""


def applications(home: Path) -> list[tuple[str, str]]:
    """(name, state) of everything in a home's database, which may have no tables yet."""
    engine = make_engine(Settings(home=home).database_url)
    try:
        if not inspect(engine).has_table(Application.__tablename__):
            return []
        with reading(engine) as session:
            return [(row.name, row.state) for row in session.execute(select(Application.name, Application.state))]
    finally:
        engine.dispose()


def test_a_run_ends_with_a_design_and_its_files(home: Path, tmp_path: Path) -> None:
    done = armature(home, "run", quick_copy("single_task.yaml", tmp_path), "--workers", "1", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    for expected in ("Design (two_step)", "resist.", "What binds:", "joint", "Task 'lift the arm'", "regret"):
        assert expected in done.stdout
    assert "succeeded; best 0.31" in done.stderr
    assert "\x1b" not in done.stdout + done.stderr  # no terminal, no escape codes
    assert processes_of(home) == []

    (folder,) = (tmp_path / "out").iterdir()
    assert folder.name.startswith("single-task-")
    assert str(folder) in done.stderr
    for name in ("application", "tasks", "design", "designs", "comparison"):
        assert json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    motions = {path.name for path in (folder / "trajectories").iterdir()}
    assert motions == {"task-000-own.json", "task-000-two_step.json"}
    design = json.loads((folder / "design.json").read_text(encoding="utf-8"))
    assert len(design["motors"]) == 6
    assert all(len(motor["dimensions_mm"]) == 7 for motor in design["motors"])
    status = json.loads((folder / "application.json").read_text(encoding="utf-8"))
    assert status["state"] == "succeeded"


def test_failed_tasks_are_named_with_their_reasons(home: Path, tmp_path: Path) -> None:
    """One task too fast for the rotors, one that can be done: exit code 10, and the reason on the screen."""
    tasks = [
        {"name": "can be done", "start_rad": [0.4] * 6, "end_rad": [0.0] * 6, "duration_s": 1.0},
        {"name": "too fast", "start_rad": [1.0] * 6, "end_rad": [0.0] * 6, "duration_s": 0.2},
    ]
    file = tmp_path / "two.json"
    content = {"name": "two", "objective": {"kind": "energy"}, "transcription": QUICK, "tasks": tasks}
    file.write_text(json.dumps(content), encoding="utf-8")
    done = armature(home, "run", file, "--out", tmp_path / "out", "--json")
    assert done.returncode == 10, done.stderr
    answer = json.loads(done.stdout)
    assert answer["state"] == "completed_with_failures"
    assert "rotor" in answer["excluded_tasks"][0]["reason"]


def test_refused_input_is_named_and_nothing_is_stored(home: Path, tmp_path: Path) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text(
        "name: bad\nrobot: ur5\ntasks:\n"
        "  - {start_rad: [9, 0, 0, 0, 0, 0], end_rad: [0, 0, 0, 0, 0, .nan], payload_kg: -1, speed: 3}\n",
        encoding="utf-8",
    )
    done = armature(home, "run", file, "--out", tmp_path / "out")
    assert done.returncode == 3
    for expected in (
        "tasks[0].payload_kg = -1: input should be greater than or equal to 0",
        "tasks[0].speed = 3: unknown field",
        "tasks[0].end_rad[5] = nan: input should be a finite number",
    ):
        assert expected in done.stderr
    assert "Traceback" not in done.stderr
    assert applications(home) == []
    assert not (tmp_path / "out").exists()
    assert processes_of(home) == []


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("name: [unfinished", "is not YAML: line "),
        ("name: a\nname: b\n", "'name' is given twice"),
        ("just text", "not an application"),
        (None, "there is no file"),
    ],
)
def test_a_file_that_is_none(home: Path, tmp_path: Path, content: str | None, said: str) -> None:
    file = tmp_path / "file.yaml"
    if content is not None:
        file.write_text(content, encoding="utf-8")
    done = armature(home, "run", file)
    assert done.returncode == 3
    assert said in done.stderr
    assert not (home / "armature.db").exists()  # refused before anything was started


def test_ctrl_c_cancels_and_leaves_no_process(home: Path, tmp_path: Path) -> None:
    process = start(home, "run", PAPER, "--workers", "2", "--out", tmp_path / "out")
    said = read_until(process.stderr, RUNNING)
    assert len(processes_of(home)) >= 6  # this one, the supervisor, API, relay, worker, its two children
    _, rest = interrupt(process)
    assert process.returncode == 130, [*said, rest]
    assert "cancelling" in rest
    assert "Traceback" not in rest
    assert processes_of(home) == []
    assert applications(home) == [("pick-and-place", "cancelled")]


def test_sigterm_ends_it_like_ctrl_c(home: Path, tmp_path: Path) -> None:
    process = start(home, "run", PAPER, "--out", tmp_path / "out")
    read_until(process.stderr, RUNNING)
    process.terminate()
    process.communicate(timeout=60)
    assert process.returncode == 130
    assert processes_of(home) == []
    assert applications(home) == [("pick-and-place", "cancelled")]


def test_no_process_outlives_a_killed_run(home: Path, tmp_path: Path) -> None:
    """SIGKILL leaves no time to clean up: the supervisor sees its pipe end. The application waits for a next worker."""
    process = start(home, "run", PAPER, "--out", tmp_path / "out")
    read_until(process.stderr, RUNNING)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate(timeout=60)
    assert wait_until_gone(home, LONGEST_LIFE_AFTER_KILL_S) == []
    assert applications(home) == [("pick-and-place", "running")]  # its jobs were given back


@pytest.mark.parametrize("delay_s", [0.5, 1.0, 1.5, 2.0])
def test_ctrl_c_while_it_starts(home: Path, tmp_path: Path, delay_s: float) -> None:
    """Whatever is half started then is stopped; an application that was submitted already is cancelled."""
    process = start(home, "run", PAPER, "--out", tmp_path / "out")
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(delay_s)
    interrupt(process)
    assert process.returncode in (130, -signal.SIGINT)  # the latter while Python itself starts
    assert processes_of(home) == []
    if (home / "armature.db").exists():  # maybe still without its tables
        assert {state for _, state in applications(home)} <= {"cancelled"}
