"""Each format read by another program's reader gives the numbers that were written, to the last digit."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml

from armature.export.designs import design_columns
from armature.export.files import Format, write_designs, write_motion
from armature.export.motion_columns import QUANTITIES, joint_acceleration
from armature.export.ros import duration
from services.codesign.collocation import collocation_points
from shared.contracts.comparisons import DesignsAnswer
from shared.contracts.motions import Trajectory

JOINTS, INTERVALS, FINAL_TIME_S = 3, 7, 0.7368294716
DESIGNS = DesignsAnswer.model_validate(
    {
        "dimensions": ["L", "h_m"],
        "tasks": [{"index": 0, "name": "pick, then place", "design_mm": [[0.1 + 0.2, 1 / 3], [2.0, 3.0]]}],
        "mean": {"design_mm": [[1.0, 2.0], [3.0, 4.0]]},
        "methods": {"two_step": {"design_mm": [[5.0, 6.0], [7.0, 1e-17]]}},
    }
)


def motion(scheme: str = "radau", degree: int = 2) -> Trajectory:
    """A motion whose numbers have all their digits, with every collocation point in its grid."""
    breaks = np.linspace(0, FINAL_TIME_S, INTERVALS + 1)
    shares = {0.0, 1.0, *collocation_points(scheme, degree)}
    time = np.unique(np.concatenate([breaks[w] + np.array(sorted(shares)) * breaks[1] for w in range(INTERVALS)]))
    time = time[np.concatenate([[True], np.diff(time) > 1e-12])]
    random = np.random.default_rng(1)
    values = {name: random.normal(size=(len(time), JOINTS)).tolist() for name in QUANTITIES}
    values["joint_speed_rad_s"] = np.stack([time**k for k in range(JOINTS)], axis=1).tolist()
    rows = np.zeros((INTERVALS, 1, JOINTS)).tolist()
    control = {"kind": "piecewise_constant", "description": "", "breaks_s": breaks.tolist()}
    control |= {"voltage_d_V": rows, "voltage_q_V": rows}
    content = {"application_id": "a", "task": 0, "method": "own", "time_s": time.tolist(), **values}
    return Trajectory.model_validate(
        {**content, "control": control, "design_mm": [], "scheme": scheme, "degree": degree}
    )


def assert_columns(read: Any, wanted: Trajectory) -> None:
    """Columns named quantity_joint hold exactly what was written."""
    assert list(read["time_s"]) == wanted.time_s
    for name in QUANTITIES:
        for joint in range(JOINTS):
            assert list(read[f"{name}_{joint + 1}"]) == [row[joint] for row in getattr(wanted, name)]
    assert len(list(read)) == 1 + len(QUANTITIES) * JOINTS


def test_csv(tmp_path: Path) -> None:
    path = tmp_path / "motion.csv"
    write_motion(motion(), path, Format.CSV)
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert_columns({name: [float(row[name]) for row in rows] for name in rows[0]}, motion())


def test_parquet(tmp_path: Path) -> None:
    path = tmp_path / "motion.parquet"
    write_motion(motion(), path, Format.PARQUET)
    assert_columns(pd.read_parquet(path), motion())


def test_npz(tmp_path: Path) -> None:
    path = tmp_path / "motion.npz"
    write_motion(motion(), path, Format.NPZ, ["base", "elbow", "wrist"])
    with np.load(path, allow_pickle=False) as read:
        assert read["joint_names"].tolist() == ["base", "elbow", "wrist"]
        assert read["time_s"].tolist() == motion().time_s
        for name in QUANTITIES:
            assert read[name].tolist() == getattr(motion(), name)


def test_joint_csv(tmp_path: Path) -> None:
    """A column a joint and quantity, under the joint's name, with the unit."""
    path, wanted = tmp_path / "motion.joints.csv", motion()
    write_motion(wanted, path, Format.JOINT_CSV, ["base", "elbow", "wrist"])
    table = pd.read_csv(path)
    quantities = ("position_rad", "speed_rad_s", "acceleration_rad_s2", "torque_Nm")
    assert list(table)[:5] == ["time_s", *(f"base_{quantity}" for quantity in quantities)]
    assert len(list(table)) == 1 + 4 * JOINTS
    assert table["time_s"].tolist() == wanted.time_s
    assert table["elbow_position_rad"].tolist() == [row[1] for row in wanted.joint_position_rad]
    assert table["wrist_speed_rad_s"].tolist() == [row[2] for row in wanted.joint_speed_rad_s]
    assert table["wrist_torque_Nm"].tolist() == [row[2] for row in wanted.joint_torque_Nm]
    assert table["elbow_acceleration_rad_s2"].tolist() == joint_acceleration(wanted)[:, 1].tolist()


def test_a_write_that_fails_leaves_the_file_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither half a file nor a part of one; what was there before stays."""

    def break_off(_columns: Any, path: Path) -> None:
        path.write_text("half")
        raise OSError("no space left")

    path = tmp_path / "motion.csv"
    path.write_text("before")
    monkeypatch.setattr("armature.export.files.write_csv", break_off)
    with pytest.raises(OSError, match="no space left"):
        write_motion(motion(), path, Format.CSV)
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("motion.csv", "before")]


@pytest.mark.parametrize(("kind", "load"), [(Format.ROS_JSON, json.loads), (Format.ROS_YAML, yaml.safe_load)])
def test_ros(tmp_path: Path, kind: Format, load: Any) -> None:
    """The fields of trajectory_msgs/JointTrajectory and JointTrajectoryPoint, all of them and no other.

    ros2/common_interfaces: JointTrajectory = std_msgs/Header header, string[] joint_names, JointTrajectoryPoint[]
    points; JointTrajectoryPoint = float64[] positions (rad), velocities (rad/s), accelerations (rad/s2), effort (N m)
    and builtin_interfaces/Duration time_from_start (int32 sec, uint32 nanosec).
    """
    path, wanted = tmp_path / "motion", motion()
    write_motion(wanted, path, kind)
    message = load(path.read_text())
    assert all(type(value) is float for point in message["points"] for value in point["accelerations"])
    assert set(message) == {"header", "joint_names", "points"}
    assert message["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    assert message["joint_names"] == ["joint_1", "joint_2", "joint_3"]
    points = message["points"]
    fields = {"positions", "velocities", "accelerations", "effort", "time_from_start"}
    assert all(set(point) == fields for point in points)
    assert [point["positions"] for point in points] == wanted.joint_position_rad
    assert [point["velocities"] for point in points] == wanted.joint_speed_rad_s
    assert [point["effort"] for point in points] == wanted.joint_torque_Nm
    assert [point["accelerations"] for point in points] == joint_acceleration(wanted).tolist()
    times = [point["time_from_start"] for point in points]
    assert all(type(time[part]) is int for time in times for part in ("sec", "nanosec"))
    assert [time["sec"] + 1e-9 * time["nanosec"] for time in times] == pytest.approx(wanted.time_s, abs=0.5001e-9)


@pytest.mark.parametrize(
    ("seconds", "sec", "nanosec"), [(0.0, 0, 0), (1.5, 1, 500_000_000), (0.9999999999, 1, 0), (2.000000001, 2, 1)]
)
def test_durations_stay_below_a_second_of_nanoseconds(seconds: float, sec: int, nanosec: int) -> None:
    assert duration(seconds) == {"sec": sec, "nanosec": nanosec}


def test_wrong_number_of_joint_names(tmp_path: Path) -> None:
    for names, why in ((["base"], "1 were given, the robot has 3 joints"), (["a", "b", "a"], "one comes twice")):
        with pytest.raises(ValueError, match=why):
            write_motion(motion(), tmp_path / "motion.json", Format.ROS_JSON, names)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("scheme", ["radau", "legendre"])
def test_accelerations_are_the_derivative_of_the_speeds(scheme: str) -> None:
    """Speeds 1, t, t^2 are polynomials of the scheme's degree, so their derivatives 0, 1, 2 t come out exactly."""
    time = np.array(motion(scheme).time_s)
    exact = np.stack([0 * time, 1 + 0 * time, 2 * time], axis=1)
    np.testing.assert_allclose(joint_acceleration(motion(scheme)), exact, atol=1e-10)


def test_accelerations_of_the_lowest_degree_are_differences() -> None:
    grid = motion("radau", 1)
    time, speed = np.array(grid.time_s), np.array(grid.joint_speed_rad_s)
    differences = np.diff(speed, axis=0) / np.diff(time)[:, None]
    np.testing.assert_allclose(joint_acceleration(grid), np.vstack([differences[:1], differences]), atol=1e-10)


@pytest.mark.parametrize(("kind", "read"), [(Format.CSV, pd.read_csv), (Format.PARQUET, pd.read_parquet)])
def test_designs(tmp_path: Path, kind: Format, read: Any) -> None:
    path = tmp_path / f"designs{kind.suffix}"
    write_designs(DESIGNS, path, kind)
    options = {"keep_default_na": False} if kind is Format.CSV else {}
    table = read(path, **options)
    assert list(table) == ["design", "task", "joint", "L_mm", "h_m_mm"]
    assert {name: table[name].tolist() for name in table} == design_columns(DESIGNS)
    assert table["L_mm"].tolist() == [0.1 + 0.2, 2.0, 1.0, 3.0, 5.0, 7.0]
    assert table["design"].tolist() == ["own", "own", "mean", "mean", "two_step", "two_step"]
