"""`armature doctor` on machines and settings with something wrong: what is found, and what to do about it."""

from __future__ import annotations

import json
import os
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result
from typer.testing import CliRunner

from armature.cli.commands import app
from armature.doctor.examine import healthy
from armature.doctor.finding import Finding, Level
from armature.doctor.machine import compiler, cores, disk, kernel_cache, memory
from armature.doctor.solver import judged, trial_solve
from armature.doctor.stores import broker, database
from armature.doctor.trial import EXPECTED_S, TOLERANCE_S
from services.codesign.kernels import cache_key
from services.codesign.motor_data import MotorData
from services.codesign.problem import FIRST, Objective, Problem, Task
from services.codesign.robot import Robot
from shared.db.migrate import downgrade, upgrade
from shared.db.revision import HEAD
from shared.settings import Settings
from tests.servers import Server, free_port, postgres_database

TRIAL: dict[str, Any] = {
    "success": True,
    "status": "Solve_Succeeded",
    "final_time_s": EXPECTED_S,
    "expected_s": EXPECTED_S,
    "tolerance_s": TOLERANCE_S,
    "iterations": 37,
    "solve_time_s": 1.0,
    "prepare_time_s": 0.1,
    "compiled": True,
    "linear_solver": "staged",
}


def assert_found(finding: Finding, level: Level, *texts: str) -> None:
    """The level, what was found, and advice wherever something is wrong."""
    assert finding.level is level, finding
    for text in texts:
        assert text in f"{finding.found}\n{finding.advice}"
    assert (finding.advice is None) == (level is Level.OK)


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    """An ARMATURE_HOME that is not there yet."""
    return Settings(home=tmp_path / "home", workers=1)


def run(home: Path, *arguments: str, **more: str) -> Result:
    return CliRunner().invoke(app, ["doctor", "--quick", *arguments], env={"ARMATURE_HOME": str(home), **more})


def test_nothing_is_made_by_looking(settings: Settings) -> None:
    """A machine on which nothing was started yet is well."""
    done = run(settings.home)
    assert done.exit_code == 0, done.output
    assert [line[:4].strip() for line in done.stdout.splitlines()] == ["ok"] * 8
    assert "IPOPT 3." in done.stdout
    assert not settings.home.exists()


def test_no_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    assert_found(compiler(), Level.WARN, "none", "install one", "thirty times")


def test_a_compiler_that_does_not_compile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Such as one without the C library's headers."""
    fake = tmp_path / "cc"
    fake.write_text("#!/bin/sh\necho 'trial.c:1:10: fatal error: math.h: No such file or directory' >&2\nexit 1\n")
    fake.chmod(0o755)
    monkeypatch.setenv("CC", str(fake))
    assert_found(compiler(), Level.FAIL, f"{fake} cannot compile a C file", "math.h", "libc6-dev")
    monkeypatch.delenv("CC")
    assert_found(compiler(), Level.OK)


def test_the_embedded_database(settings: Settings) -> None:
    path = settings.home / "armature.db"
    assert_found(database(settings), Level.OK, "not there yet")
    upgrade(settings.database_url)
    assert_found(database(settings), Level.OK, str(path), HEAD)
    downgrade(settings.database_url, "0001")
    assert_found(database(settings), Level.WARN, "at revision 0001", HEAD, "armature up")
    with sqlite3.connect(path) as connection:
        connection.execute("UPDATE alembic_version SET version_num = 'later'")
    connection.close()
    assert_found(database(settings), Level.FAIL, "later", "does not know", "newer")


def test_a_damaged_file(settings: Settings) -> None:
    """Found although its revision can be read; and a file that is no database at all."""
    path = settings.home / "armature.db"
    upgrade(settings.database_url)
    with path.open("r+b") as file:
        file.seek(-4096, os.SEEK_END)
        file.write(b"\xff" * 4096)
    assert_found(database(settings), Level.FAIL, str(path), "damaged", "restore")
    path.write_bytes(b"not a database " * 1000)
    assert_found(database(settings), Level.FAIL, "not a database", "restore")


def test_a_database_server(postgres: Server, settings: Settings) -> None:
    """Behind: somebody has to migrate, for nothing does it by itself. Not there: said within seconds."""
    with postgres_database(postgres) as url:
        there = settings.model_copy(update={"database_url": url})
        assert_found(database(there), Level.FAIL, "at revision none", "armature migrate")
        upgrade(url, "0001")
        assert_found(database(there), Level.FAIL, "at revision 0001", "armature migrate")
        upgrade(url)
        assert_found(database(there), Level.OK)
    away = f"postgresql://somebody:secret@127.0.0.1:{free_port()}/armature"
    finding = database(settings.model_copy(update={"database_url": away}))
    assert_found(finding, Level.FAIL, "refused", "ARMATURE_DATABASE_URL")
    assert "secret" not in finding.model_dump_json()


def test_a_broker_that_is_away(redis: Server, settings: Settings) -> None:
    assert_found(broker(settings), Level.OK, "not there yet")
    assert_found(broker(settings.model_copy(update={"broker_url": redis.url})), Level.OK)
    away = settings.model_copy(update={"broker_url": f"redis://:secret@127.0.0.1:{free_port()}/0"})
    assert_found(broker(away), Level.FAIL, "does not answer", "ARMATURE_BROKER_URL")
    assert "secret" not in broker(away).model_dump_json()
    nonsense = settings.model_copy(update={"broker_url": "carrier-pigeon://loft"})
    assert_found(broker(nonsense), Level.FAIL, "carrier-pigeon")


def test_more_workers_than_the_machine_can_take(settings: Settings) -> None:
    assert_found(cores(settings), Level.OK)
    many = settings.model_copy(update={"workers": 4000})
    assert_found(cores(many), Level.WARN, "4000", "ARMATURE_WORKERS=")
    assert_found(memory(many), Level.WARN, "lower ARMATURE_WORKERS")


def test_a_full_disk(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    levels = {3e9: Level.OK, 1e9: Level.WARN, 1e8: Level.FAIL}
    for free, level in levels.items():
        monkeypatch.setattr("shutil.disk_usage", lambda _place, free=free: type("Usage", (), {"free": free}))
        assert_found(disk(settings), level, f"{free / 1e9:.1f} GB free")


def test_kernels_are_counted(settings: Settings) -> None:
    settings.kernel_cache.mkdir(parents=True)
    (settings.kernel_cache / "one.so").write_bytes(b"x" * 3_000_000)
    assert_found(kernel_cache(settings), Level.OK, "1 compiled libraries, 3 MB")


def test_a_solve_whose_answer_is_known(home: Path) -> None:
    """A real one; and one whose compiled code is not code for this machine, in a process that it cannot take along."""
    assert_found(trial_solve(Settings(home=home)), Level.OK, "iterations, linear solver staged")
    broken = home.parent / "broken"
    task = Task(np.zeros(6), np.zeros(6))
    problem = Problem(Robot.preset("ur5"), task, MotorData(), Objective("time"), FIRST)
    (broken / "kernels").mkdir(parents=True)
    (broken / "kernels" / f"{cache_key(problem.robot, problem.layout)}.so").write_bytes(b"no code")
    assert_found(trial_solve(Settings(home=broken)), Level.FAIL, "its process ended", "empty the kernels' folder")


def test_a_solve_is_judged() -> None:
    assert_found(judged(TRIAL), Level.OK, "1.00 s, 37 iterations")
    assert_found(judged(TRIAL | {"prepare_time_s": 40.0}), Level.OK, "40 s to compile kernels, once")
    assert_found(judged(TRIAL | {"solve_time_s": 30.0}), Level.WARN, "slow")
    assert_found(judged(TRIAL | {"linear_solver": "mumps"}), Level.WARN, "compiler")
    assert_found(judged(TRIAL | {"final_time_s": EXPECTED_S + 0.001}), Level.FAIL, "not 0.313153 s")
    failed = TRIAL | {"success": False, "status": "Invalid_Number_Detected", "final_time_s": None}
    assert_found(judged(failed), Level.FAIL, "Invalid_Number_Detected")


def test_what_a_script_is_told(settings: Settings) -> None:
    """The exit code, and one JSON object; a warning alone is no failure."""
    upgrade(settings.database_url)
    (settings.home / "armature.db").write_bytes(b"garbage" * 1000)
    done = run(settings.home, "--json")
    assert done.exit_code == 1
    answer = json.loads(done.stdout)
    assert answer["healthy"] is False
    assert [finding["subject"] for finding in answer["findings"] if finding["level"] == "fail"] == ["database"]
    warned = run(settings.home.parent / "other", ARMATURE_WORKERS="4000")
    assert warned.exit_code == 0
    assert "warn  cores" in warned.stdout
    assert not healthy([Finding(subject="a", level=Level.FAIL, found="", advice="")])
