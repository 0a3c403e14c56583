"""Why the mean design is slow: the paper's 25 motions once more, with other magnets in the two-step design.

    python docs/magnet_heights.py OUT/pick-and-place-ID

A hundred solves, one after the other. The text is docs/paper_study.md, "Why the mean loses".
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from services.codesign.motor_data import DIMENSIONS
from services.codesign.problem import Objective, Problem, Task
from services.codesign.robot import Robot
from services.codesign.solve import solve
from shared.contracts.comparisons import DesignAnswer

STROKES = (0.2, 0.4, 0.6, 0.8, 1.0)  # rad
PAYLOADS = (0.0, 1.0, 2.0, 3.0, 4.0)  # kg
VARIANTS = {
    "as it is": {},
    "joint 2: 1.0 mm": {2: 1.0},
    "joints 4, 5, 6: 1.5 mm": {4: 1.5, 5: 1.5, 6: 1.5},
    "joint 2: 1.0 mm, joints 4, 5, 6: 1.5 mm": {2: 1.0, 4: 1.5, 5: 1.5, 6: 1.5},
}
"""Magnet heights by joint [mm]; the other dimensions stay. Thinner magnets break no limit of the design."""


def main(folder: Path) -> None:
    """Print the total time with each variant, and the times for each stroke."""
    design_mm = np.array(DesignAnswer.model_validate_json((folder / "design.json").read_bytes()).design_mm)
    for name, heights in VARIANTS.items():
        changed = design_mm.copy()
        for joint, height in heights.items():
            changed[joint - 1, DIMENSIONS.index("h_m")] = height
        times = np.array([[_time(changed / 1e3, stroke, payload) for payload in PAYLOADS] for stroke in STROKES])
        each = ", ".join(
            f"{stroke:g} rad {total:.4f}" for stroke, total in zip(STROKES, times.sum(axis=1), strict=True)
        )
        print(f"{name}: {times.sum():.4f} s ({each})", flush=True)


def _time(design: np.ndarray, stroke: float, payload: float) -> float:
    """Minimum time [s] of a task of the paper with given motors, (6, 7) m; NaN when there is no motion."""
    task = Task(np.full(6, stroke), np.zeros(6), payload)
    solution = solve(Problem(Robot.preset("ur5"), task, objective=Objective("time"), design=design))
    return np.nan if solution.objective is None else solution.objective


if __name__ == "__main__":
    main(Path(sys.argv[1]))
