"""Twelve different applications: other strokes, payloads, arms, gear ratios and objectives, every method.

python -m benchmarks.studies.twelve_applications        results/twelve_applications.json
"""

from __future__ import annotations

from itertools import product
from typing import Any

from benchmarks.studies.records import ALL_METHODS, PAPER, run

STUDY = "twelve_applications"
ROBOTS = ("ur5", "ur5_modern_robotics")
GEARS = (80.0, 100.0, 120.0)
OBJECTIVES: dict[str, dict[str, Any]] = {
    "time": {"kind": "time"},
    "energy": {"kind": "energy"},
    "weighted": {"kind": "weighted", "alpha": 0.5},
    "electrical_energy": {"kind": "electrical_energy"},
}
STROKES = ([0.2, 0.5, 0.8], [0.3, 0.6, 0.9], [0.4, 0.7, 1.0], [0.25, 0.45, 0.65], [0.1, 0.3, 1.0], [0.35, 0.55, 0.95])
PAYLOADS_KG = ([0.0, 3.0], [1.0, 4.0], [0.5, 2.0], [0.0, 4.0])
DURATIONS_S = (1.0, 1.2, 1.4)


def requests() -> dict[str, dict[str, Any]]:
    """Four objectives with three gear ratios each; arms, strokes, payloads and durations change on the way."""
    found: dict[str, dict[str, Any]] = {}
    for k, ((name, objective), gear) in enumerate(product(OBJECTIVES.items(), GEARS)):
        grid = {
            "stroke": STROKES[k % len(STROKES)],
            "payload_kg": PAYLOADS_KG[k % len(PAYLOADS_KG)],
            "duration_s": DURATIONS_S[k // len(OBJECTIVES)],
        }
        label = f"{name}, {gear:g}:1"
        found[label] = {
            "name": label,
            "robot": ROBOTS[k % len(ROBOTS)],
            "robot_changes": {"gear_ratio": [gear]},
            "objective": objective,
            "tasks": {"grid": grid},
            "transcription": PAPER,
            **ALL_METHODS,
        }
    return found


def main() -> None:
    """Run what is not stored yet, and print the totals."""
    for name, record in run(STUDY, requests()).items():
        totals = {method: round(found.total_objective, 4) for method, found in record.comparison.methods.items()}
        print(name, totals, {method: len(tasks) for method, tasks in record.failed.items() if tasks})


if __name__ == "__main__":
    main()
