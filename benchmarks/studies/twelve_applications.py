"""Twelve different applications: other strokes, payloads, arms, gear ratios and objectives, every method.

Four tasks each on 25 intervals: what is compared is methods, on the same program.

python -m benchmarks.studies.twelve_applications        results/twelve_applications.json
"""

from __future__ import annotations

from itertools import product
from typing import Any

from benchmarks.studies.records import ALL_METHODS, PAPER, asked_again, run

STUDY = "twelve_applications"
ROBOTS = ("ur5", "ur5_modern_robotics")
GEARS = (80.0, 100.0, 120.0)
OBJECTIVES: dict[str, dict[str, Any]] = {
    "time": {"kind": "time"},
    "energy": {"kind": "energy"},
    "weighted": {"kind": "weighted", "alpha": 0.5},
    "electrical_energy": {"kind": "electrical_energy"},
}
STROKES = ([0.2, 0.8], [0.3, 0.9], [0.4, 1.0], [0.25, 0.65], [0.15, 1.0], [0.35, 0.95])
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
            "transcription": PAPER | {"intervals": 25},
            **ALL_METHODS,
        }
    return found


def main() -> None:
    """Run what is not stored yet, and print the totals."""
    for name, record in run(STUDY, requests(), again=asked_again(__doc__)).items():
        print(name, {method: (record.judged(method), record.undone(method)) for method in record.objectives})


if __name__ == "__main__":
    main()
