"""`armature robot check`: what is wrong is said, the exit code too, and the arm is drawn."""

from __future__ import annotations

import json
from pathlib import Path

from tests.acceptance.cli import EXAMPLES, armature


def test_check_shows_an_arm_and_draws_it(tmp_path: Path) -> None:
    drawing = tmp_path / "arm.svg"
    done = armature(tmp_path, "robot", "check", EXAMPLES / "my_arm.yaml", "--draw", drawing)
    assert done.returncode == 0, done.stderr
    assert "3 joints, reach 0.650 m" in done.stdout
    assert "nothing looks wrong" in done.stdout
    assert "centres of mass" in drawing.read_text()


def test_check_lists_what_looks_wrong(tmp_path: Path) -> None:
    done = armature(tmp_path, "robot", "check", "ur5_modern_robotics", "--json")
    assert done.returncode == 1
    assert [finding["where"] for finding in json.loads(done.stdout)] == ["link 4", "link 5", "link 6"]


def test_check_refuses_what_is_no_arm(tmp_path: Path) -> None:
    text = (EXAMPLES / "my_arm.urdf").read_text().replace('type="continuous"', 'type="prismatic"')
    (tmp_path / "slide.urdf").write_text(text)
    (tmp_path / "slide.yaml").write_text("urdf: slide.urdf\ngear_ratio: 100\n")
    done = armature(tmp_path, "robot", "check", tmp_path / "slide.yaml")
    assert done.returncode == 3
    assert "joint 'yaw' is prismatic" in done.stderr
