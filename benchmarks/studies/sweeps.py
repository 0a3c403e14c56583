"""Two sweeps of the shared optimum: the weight of energy (the time-energy front), and the gear ratio.

python -m benchmarks.studies.sweeps        results/front.json, results/gears.json
"""

from __future__ import annotations

from typing import Any

from benchmarks.studies.records import PAPER, asked_again, embedded_service, keep, solver_digest, stored_sweep

BASE: dict[str, Any] = {
    "robot": "ur5",
    "transcription": PAPER,
    "method": "shared_optimum",
}
SWEEPS: dict[str, dict[str, Any]] = {
    "front": {
        "name": "time against energy, shared optimum",
        "application": {
            **BASE,
            "objective": {"kind": "weighted"},
            "tasks": {"grid": {"stroke": [0.4, 0.8], "payload_kg": [0.0, 4.0]}},
        },
        "axes": {"objective.alpha": [0.0, 0.05, 0.2, 0.5, 0.9]},
    },
    "gears": {
        "name": "gear ratios, shared optimum",
        "application": {
            **BASE,
            "objective": {"kind": "time"},
            "tasks": {"grid": {"stroke": [0.2, 1.0], "payload_kg": [0.0, 4.0]}},
        },
        "axes": {"robot_changes.gear_ratio": [60.0, 80.0, 100.0, 120.0, 160.0]},
    },
}


def main() -> None:
    """Run what is not stored yet."""
    again = asked_again(__doc__)
    left = {name: request for name, request in SWEEPS.items() if stored_sweep(name, request, again=again) is None}
    if left:
        with embedded_service() as client:
            for name, request in left.items():
                sweep = client.submit_sweep(request)
                table = sweep.wait()
                keep(name, {"request": request, "solver": solver_digest(), "sweep": table.model_dump(mode="json")})
    for name, request in SWEEPS.items():
        table = stored_sweep(name, request)
        assert table is not None
        for point in table.points:
            totals = {method: (found.tasks, round(found.objective, 4)) for method, found in point.totals.items()}
            print(name, point.values, totals)


if __name__ == "__main__":
    main()
