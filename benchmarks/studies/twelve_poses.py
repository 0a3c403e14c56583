"""Twelve unlike poses, all methods, and every task with every other task's own design.

python -m benchmarks.studies.twelve_poses      results/twelve_poses.json, results/twelve_poses_designs.json

The second holds the table that shows what "no single design fits all" means: a row for the own design of each task, a
column for each task, its shortest time with that design [s], null where there is no motion.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from armature.application_file import read_application
from benchmarks.studies.records import RESULTS, Record, asked_again, keep, run
from services.codesign.problem import Problem, Task
from services.codesign.robot import Robot
from services.codesign.solve import solve

STUDY = "twelve_poses"
DESIGNS = "twelve_poses_designs"


def request() -> dict[str, Any]:
    """The application."""
    return dict(read_application(Path(__file__).with_suffix(".yaml")))


def every_design(record: Record) -> list[list[float | None]]:
    """Shortest times [s]: a row a task's own design, a column a task."""
    robot = Robot.preset(request()["robot"])
    tasks = [
        Task(np.array(t["start_rad"]), np.array(t["end_rad"]), t.get("payload_kg", 0.0)) for t in request()["tasks"]
    ]
    problems = [Problem(robot, task) for task in tasks]  # for time, in the paper's transcription: as the request says
    rows = []
    for own in record.designs.tasks:
        design = np.array(own.design_mm) / 1e3
        rows.append([solve(replace(problem, design=design)).objective for problem in problems])
    return rows


def main() -> None:
    """Run what is not stored yet."""
    record = run(STUDY, {"time": request()}, again=asked_again(__doc__))["time"]
    path = RESULTS / f"{DESIGNS}.json"
    stored = json.loads(path.read_bytes()) if path.exists() else {}
    designs = [task.design_mm for task in record.designs.tasks]
    if stored.get("designs_mm") != designs:
        keep(DESIGNS, {"designs_mm": designs, "times_s": every_design(record)})
    for name, method in record.comparison.methods.items():
        print(f"{name}: {method.total_objective:.4f} s, tasks without a motion: {record.undone(name)}")


if __name__ == "__main__":
    main()
