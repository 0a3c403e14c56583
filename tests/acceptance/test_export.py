"""What a real server computed, exported in every format and read back: the API's numbers, to the last digit."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pandas as pd
import pytest
import yaml
from click.testing import Result
from typer.testing import CliRunner

from armature.cli.commands import app
from armature.client import Client
from armature.export.motion_columns import QUANTITIES, joint_acceleration
from armature.processes import Place, Service, running_service
from services.codesign.robot import Robot
from shared.contracts.motions import Trajectory
from shared.settings import Settings
from tests.conftest import home_with_kernels
from tests.numerics.arms import State, Tree

JOINTS = 6
DEGREE = 3
DYNAMICS = 1e-9
"""Of the largest torque: what the solver leaves open of its equations of motion, and rounding; found 3e-12."""


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return home_with_kernels(tmp_path_factory.mktemp("export") / "home")


@pytest.fixture(scope="module")
def service(home: Path) -> Iterator[Service]:
    with running_service(Settings(home=home), Place(workers=2)) as service:
        yield service


@pytest.fixture(scope="module")
def finished(service: Service) -> str:
    """Id of an application of degree 3: two tasks that can be done, and one that cannot."""
    content = {
        "name": "to be exported",
        "transcription": {"scheme": "radau", "degree": DEGREE, "intervals": 12, "control": "voltage"},
        "tasks": [
            {"name": "reach", "start_rad": [0.4] * JOINTS, "end_rad": [0.0] * JOINTS, "payload_kg": 1.5},
            {"name": "lift", "start_rad": [0.2, 0.5, 0.1, 0, 0, 0.3], "end_rad": [0.0] * JOINTS},
            {"name": "too heavy", "start_rad": [0.4] * JOINTS, "end_rad": [0.0] * JOINTS, "payload_kg": 400.0},
        ],
    }
    with Client(service.url) as client:
        application = client.submit(content)
        assert application.wait(timeout_s=120).state == "completed_with_failures"
    return application.id


@pytest.fixture
def command(service: Service) -> Callable[..., Result]:
    """Runs a command of `armature` against the server."""

    def run(*arguments: str | Path) -> Result:
        return CliRunner().invoke(app, [*map(str, arguments), "--url", service.url])

    return run


def answer_of(service: Service, application: str, task: int, method: str = "two_step") -> dict[str, Any]:
    """A motion in the API's JSON, read by another client."""
    path = f"{service.url}/v1/applications/{application}/tasks/{task}/trajectory"
    answer: dict[str, Any] = httpx.get(path, params={"method": method}).raise_for_status().json()
    return answer


def arrays_of_columns(read: Any) -> dict[str, Any]:
    """Lists of rows again, from one column a quantity and joint."""
    columns = {name: [[float(v) for v in read[f"{name}_{k + 1}"]] for k in range(JOINTS)] for name in QUANTITIES}
    return {name: [list(row) for row in zip(*values, strict=True)] for name, values in columns.items()} | {
        "time_s": [float(value) for value in read["time_s"]]
    }


def read_csv(path: Path) -> dict[str, Any]:
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return arrays_of_columns({name: [row[name] for row in rows] for name in rows[0]})


def read_npz(path: Path) -> dict[str, Any]:
    with np.load(path, allow_pickle=False) as file:
        return {name: file[name].tolist() for name in (*QUANTITIES, "time_s")}


READERS: dict[str, Callable[[Path], dict[str, Any]]] = {
    "csv": read_csv,
    "parquet": lambda path: arrays_of_columns(pd.read_parquet(path)),
    "npz": read_npz,
}


@pytest.mark.parametrize("kind", READERS)
def test_every_number_of_a_motion_comes_back(
    service: Service, finished: str, command: Callable[..., Result], tmp_path: Path, kind: str
) -> None:
    path = tmp_path / f"motion.{kind}"
    done = command("export", finished, "--task", 0, "--method", "own", "--format", kind, "-o", path)
    assert done.exit_code == 0, done.output
    assert done.stdout == f"{path}\n"
    wanted = answer_of(service, finished, 0, "own")
    assert READERS[kind](path) == {name: wanted[name] for name in (*QUANTITIES, "time_s")}


def test_ros_messages_hold_the_motion(
    service: Service, finished: str, command: Callable[..., Result], tmp_path: Path
) -> None:
    names = "shoulder_pan_joint,shoulder_lift_joint,elbow_joint,wrist_1_joint,wrist_2_joint,wrist_3_joint"
    messages = []
    for kind, load in {"ros-json": json.loads, "ros-yaml": yaml.safe_load}.items():
        done = command("export", finished, "--task", 1, "--format", kind, "--joint-names", names, "-o", tmp_path)
        assert done.exit_code == 0, done.output
        messages.append(load(Path(done.stdout.strip()).read_text()))
    assert messages[0] == messages[1]
    wanted = answer_of(service, finished, 1)
    points = messages[0]["points"]
    assert messages[0]["joint_names"] == names.split(",")
    assert [point["positions"] for point in points] == wanted["joint_position_rad"]
    assert [point["velocities"] for point in points] == wanted["joint_speed_rad_s"]
    assert [point["effort"] for point in points] == wanted["joint_torque_Nm"]
    times = [point["time_from_start"]["sec"] + 1e-9 * point["time_from_start"]["nanosec"] for point in points]
    assert times == pytest.approx(wanted["time_s"], abs=0.5001e-9)


def test_accelerations_are_those_of_the_dynamics(service: Service, finished: str) -> None:
    """Pinocchio's torques for the exported accelerations are the motors' torques, at every collocation point."""
    motion = Trajectory.model_validate(answer_of(service, finished, 0))
    acceleration = joint_acceleration(motion)
    robot, torque = Robot.preset("ur5"), np.array(motion.joint_torque_Nm)
    found = np.empty_like(torque)
    for k, (q, qd) in enumerate(zip(motion.joint_position_rad, motion.joint_speed_rad_s, strict=True)):
        design = np.array(motion.design_mm) * 1e-3
        state = State(design, 1.5, robot.gear_ratio, np.array(q), np.array(qd), acceleration[k])
        found[k] = Tree(robot, state).torques(state)
    assert len(motion.time_s) == 12 * DEGREE + 1
    assert np.abs(found - torque)[1:].max() < DYNAMICS * np.abs(torque).max()


def test_all_motions_and_those_that_are_missing(finished: str, command: Callable[..., Result], tmp_path: Path) -> None:
    """A task without a motion is named, with its reason, and the exit code says that not all is there."""
    done = command("export", finished, "--all", "--format", "joint-csv", "-o", tmp_path / "all", "--json")
    assert done.exit_code == 10
    content = json.loads(done.stdout)
    files = [f"task-{k:03d}-two_step.joints.csv" for k in (0, 1)]
    assert content["files"] == [str(tmp_path / "all" / name) for name in files]
    assert sorted(path.name for path in (tmp_path / "all").iterdir()) == files
    (missing,) = content["left_out"]
    assert (missing["task"], missing["name"]) == (2, "too heavy")
    assert "joint 2" in missing["reason"]
    assert "left out: task 2, too heavy: " in done.stderr


def test_designs(service: Service, finished: str, command: Callable[..., Result], tmp_path: Path) -> None:
    wanted = httpx.get(f"{service.url}/v1/applications/{finished}/designs").json()
    lengths = [f"{name}_mm" for name in wanted["dimensions"]]
    for kind, read in {"csv": pd.read_csv, "parquet": pd.read_parquet}.items():
        done = command("export", finished, "--designs", "--format", kind, "-o", tmp_path / f"designs.{kind}")
        assert done.exit_code == 0, done.output
        table = read(tmp_path / f"designs.{kind}")
        for task in wanted["tasks"]:
            assert table[table["task"] == task["name"]][lengths].to_numpy().tolist() == task["design_mm"]
        assert (
            table[table["design"] == "two_step"][lengths].to_numpy().tolist()
            == (wanted["methods"]["two_step"]["design_mm"])
        )


def test_a_motion_and_a_log_in_the_terminal(service: Service, finished: str, command: Callable[..., Result]) -> None:
    motion = command("trajectory", finished, 0, "--json")
    assert json.loads(motion.stdout) == answer_of(service, finished, 0)
    table = command("trajectory", finished, 0)
    assert table.exit_code == 0, table.output
    assert "+0.4000" in table.stdout.splitlines()[4]
    failed = command("log", finished, 2, "--method", "own")
    assert failed.exit_code == 0, failed.output
    assert "joint 2" in failed.stdout
    log = json.loads(command("log", finished, 0, "--method", "own", "--json").stdout)
    assert len(log["iterations"]) > 5
    assert command("trajectory", finished, 2).exit_code == 4


def test_report_and_figures(finished: str, command: Callable[..., Result], tmp_path: Path) -> None:
    """One page with what failed in it; figures as PDF, drawn as lines and with letters that can be searched."""
    out, folder = tmp_path / "report.html", tmp_path / "figures"
    done = command("report", finished, "-o", out, "--figures", folder, "--json")
    assert done.exit_code == 0, done.output
    written = json.loads(done.stdout)
    assert written["report"] == str(out)
    page = out.read_text(encoding="utf-8")
    assert "task 2, too heavy: " in page
    assert page.count("<svg") == 3
    assert sorted(Path(path).name for path in written["figures"]) == [
        "motion-001-two_step.pdf",
        "motors.pdf",
        "totals.pdf",
    ]
    for path in written["figures"]:
        content = Path(path).read_bytes()
        assert content.startswith(b"%PDF-")
        assert b"/Subtype /Image" not in content
        assert b"/Type0" in content
    svg = command("report", finished, "-o", out, "--figures", folder, "--format", "svg")
    assert (folder / "motors.svg").read_text(encoding="utf-8").startswith("<?xml"), svg.output
    assert command("report", "nothing", "-o", tmp_path / "other.html").exit_code == 4
    assert not (tmp_path / "other.html").exists()


def test_the_report_out_of_the_store(
    finished: str, command: Callable[..., Result], home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a server, to the last letter what a server answers; what is not in the store is not found."""
    asked, read = tmp_path / "asked.html", tmp_path / "read.html"
    assert command("report", finished, "-o", asked).exit_code == 0
    monkeypatch.setenv("ARMATURE_HOME", str(home))
    done = CliRunner().invoke(app, ["report", finished, "--local", "-o", str(read), "--url", "http://127.0.0.1:9"])
    assert done.exit_code == 0, done.output
    assert read.read_bytes() == asked.read_bytes()
    missing = CliRunner().invoke(app, ["report", "nothing", "--local", "-o", str(tmp_path / "none.html")])
    assert missing.exit_code == 4
    assert "armature.db" in missing.output


def test_delete(service: Service, command: Callable[..., Result]) -> None:
    """Asks first; then nothing is left, and a second time there is nothing to delete."""
    with Client(service.url) as client:
        task = {"start_rad": [0.1] * JOINTS, "end_rad": [0.0] * JOINTS}
        application = client.submit({"name": "to be deleted", "tasks": [task]})
        application.cancel()
        application.wait(timeout_s=60)
    asked = CliRunner().invoke(app, ["delete", application.id, "--url", service.url], input="n\n")
    assert asked.exit_code == 1
    assert httpx.get(f"{service.url}/v1/applications/{application.id}").status_code == 200
    assert json.loads(command("delete", application.id, "--yes", "--json").stdout) == {
        "id": application.id,
        "deleted": True,
    }
    assert httpx.get(f"{service.url}/v1/applications/{application.id}").status_code == 404
    assert command("delete", application.id, "--yes").exit_code == 4
