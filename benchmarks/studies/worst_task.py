"""One design for the sum of the tasks' times, for the worst task, and for a mix: the same tasks three times.

python -m benchmarks.studies.worst_task        results/worst_task.json
"""

from __future__ import annotations

from typing import Any

from benchmarks.studies.records import PAPER, asked_again, run

STUDY = "worst_task"
OVER_TASKS: dict[str, dict[str, Any]] = {
    "sum": {"kind": "sum"},
    "mix": {"kind": "mix", "share": 0.5},
    "worst": {"kind": "worst"},
}
TASKS = [
    {"name": "base, 0.8 rad", "start_rad": [0.8, -0.9, 1.4, -0.5, 0, 0], "end_rad": [0, -0.9, 1.4, -0.5, 0, 0]},
    {"name": "shoulder, 0.9 rad", "start_rad": [0, -1.3, 0.8, 0, 0, 0], "end_rad": [0, -0.4, 0.8, 0, 0, 0]},
    {
        "name": "shoulder, 0.7 rad, 4 kg",
        "start_rad": [0, -0.1, 0.2, 0, 0, 0],
        "end_rad": [0, -0.8, 0.2, 0, 0, 0],
        "payload_kg": 4.0,
    },
    {
        "name": "elbow, 0.8 rad, 4 kg",
        "start_rad": [0.4, -0.7, 0.9, 0, 0, 0],
        "end_rad": [0.4, -0.7, 0.1, 0, 0, 0],
        "payload_kg": 4.0,
    },
    *(
        {
            "name": f"{what}, 0.1 rad, {payload:g} kg",
            "start_rad": start,
            "end_rad": end,
            "payload_kg": payload,
            "weight": 3.0,
        }
        for what, start, end, payload in (
            ("base", [0.1, -0.2, 0, 0, 0, 0], [0, -0.2, 0, 0, 0, 0], 4.0),
            ("shoulder", [0, 0.05, 0, 0, 0, 0], [0, -0.05, 0, 0, 0, 0], 3.0),
            ("elbow", [0.4, -0.6, 0.7, 0.2, 0, 0], [0.4, -0.6, 0.6, 0.2, 0, 0], 4.0),
            ("insertion", [0.6, -0.7, 1.3, -0.6, -1.57, 0], [0.6, -0.6, 1.3, -0.7, -1.57, 0], 3.0),
        )
    ),
]
"""Long moves beside short loaded ones that occur three times as often: the sum cares for these, the worst for those."""


def requests() -> dict[str, dict[str, Any]]:
    """The application with each way to judge a design."""
    return {
        name: {
            "name": f"worst task: {name}",
            "robot": "ur5",
            "objective": {"kind": "time", "over_tasks": over_tasks},
            "tasks": TASKS,
            "transcription": PAPER,
            "method": "shared_optimum",
        }
        for name, over_tasks in OVER_TASKS.items()
    }


def main() -> None:
    """Run what is not stored yet, and print the table."""
    for name, record in run(STUDY, requests(), again=asked_again(__doc__)).items():
        found = record.comparison.methods["shared_optimum"]
        deciding = record.designs.methods["shared_optimum"].deciding_tasks or []
        print(
            f"{name}: weighted sum {found.weighted_objective:.4f} s, worst {found.worst_objective:.4f} s;"
            f" decide: {', '.join(f'{task.name} {task.share:.0%}' for task in deciding) or '-'}"
        )


if __name__ == "__main__":
    main()
