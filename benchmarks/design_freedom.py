"""What each freedom of a design brings: `python -m benchmarks.design_freedom`.

The paper's application and examples/five_poses.yaml, through the service, with gear ratios free, motors alike, sizes in
steps, and a tie-break. Figures are objectives and masses, not times, so a busy machine changes nothing. Stored case by
case in benchmarks/results/design_freedom.json; `--table` writes those of docs/design_freedom.md from there.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from armature.application_file import read_application
from armature.client import Client
from armature.processes import Place, running_service
from benchmarks.fan_out import application
from benchmarks.tables import ROOT, table
from services.codesign.kernels import default_cache
from services.codesign.motor import evaluate_motor
from services.codesign.motor_data import MotorData
from shared.contracts.comparisons import ComparisonAnswer, DesignsAnswer
from shared.settings import Settings

RESULTS = Path(__file__).parent / "results" / "design_freedom.json"
PAGE = ROOT / "docs" / "design_freedom.md"
STEPS_MM = {"L": 5, "R_ro": 1, "R_so": 1, "h_m": 0.5, "h_sy": 0.5, "w_tooth": 0.5, "b_0": 0.5}
TOLERANCES = (1e-4, 1e-3)


def cases(tasks: int) -> dict[str, dict[str, Any]]:
    """Requests by name."""
    paper = application(tasks)
    shared = paper | {"method": "shared_optimum"}
    poses = read_application(ROOT / "examples" / "five_poses.yaml")
    found = {
        "paper": shared | {"design": {"catalogue": {"steps_mm": STEPS_MM}}},
        "gears": shared | {"design": {"gear_ratios": {"all": [50, 200]}}},
        "alike": shared | {"design": {"identical": [[1, 2, 3], [4, 5, 6]]}},
        "poses": poses,
    }
    for tolerance in TOLERANCES:
        broken = {"design": {"tie_break": {"by": "mass", "tolerance": tolerance}}}
        found[f"paper, lightest within {tolerance:g}"] = paper | broken
        found[f"poses, lightest within {tolerance:g}"] = poses | broken
    return found


def measure(client: Client, request: dict[str, Any]) -> dict[str, Any]:
    """Run one application to its end: totals by method, masses and gears of its designs, spread of the own ones."""
    submitted = client.submit(request)
    status = submitted.wait()
    compared, designs = submitted.comparison(), submitted.designs()
    return {
        "design": request.get("design", {}),
        "state": status.state,
        "unit": compared.unit,
        "tasks_compared": len(compared.tasks_compared),
        "totals": {name: method.total_objective for name, method in compared.methods.items()},
        "weighted": {name: method.weighted_objective for name, method in compared.methods.items()},
        "mass_kg": _masses(designs, compared),
        "spread": _spread(designs),
        "gear_ratio": {name: design.gear_ratio for name, design in designs.methods.items() if design.gear_ratio},
    }


def _masses(designs: DesignsAnswer, compared: ComparisonAnswer) -> dict[str, float]:
    """Of all motors: each method's, and the mean over the tasks' own designs."""
    own = [_mass(task.design_mm) for task in designs.tasks]
    shared = {name: _mass(method.design_mm) for name, method in compared.methods.items() if method.design_mm}
    return {"own": float(np.mean(own)), **shared}


def _mass(design_mm: list[list[float]]) -> float:
    return sum(evaluate_motor(np.array(row) * 1e-3, MotorData())[1]["mass_kg"] for row in design_mm)


def _spread(designs: DesignsAnswer) -> list[list[float]]:
    """Standard deviation over the mean, of each joint's lengths over the tasks' own designs."""
    own = np.array([task.design_mm for task in designs.tasks])
    spread: list[list[float]] = (own.std(axis=0) / own.mean(axis=0)).tolist()
    return spread


def tables(stored: Mapping[str, Mapping[str, Any]]) -> str:
    """What the page shows."""
    rows = []
    for name, title in (("paper", "100:1, as the paper"), ("gears", "gears 50 to 200, free"), ("alike", "two motors")):
        case = stored[name]
        totals, masses = case["totals"], case["mass_kg"]
        rows.append(
            [title, *(f"{totals[m]:.4f}" for m in ("own", "two_step", "shared_optimum")),
             f"{masses['shared_optimum']:.2f}"]
        )  # fmt: skip
    freedoms = table(["total time [s]", "own designs", "two-step", "shared optimum", "its motors [kg]"], rows)
    ratios = stored["gears"]["gear_ratio"]
    gears = table(
        ["gear ratio of joint", *(str(k + 1) for k in range(6))],
        [[name.replace("_", "-"), *(f"{z:.1f}" for z in ratios[name])] for name in ("two_step", "shared_optimum")],
    )
    paper = stored["paper"]["totals"]
    loss = paper["catalogue"] / paper["shared_optimum"] - 1
    catalogue = (
        f"On those steps the shared design's total goes from {paper['shared_optimum']:.4f} s to "
        f"{paper['catalogue']:.4f} s, {loss:.2%} more."
    )
    broken = [_tie_break_row(kind, name, stored) for kind in ("paper", "poses") for name in stored if kind in name]
    ties = table(
        [
            "",
            "own designs [s]",
            "their mass [kg]",
            "spread of lengths, wrist",
            "two-step [s]",
            "its regret",
            "its mass [kg]",
        ],
        broken,
    )
    return "\n\n".join([freedoms, gears, catalogue, ties])


def _tie_break_row(kind: str, name: str, stored: Mapping[str, Mapping[str, Any]]) -> list[str]:
    case = stored[name]
    totals, masses, wrist = case["weighted"], case["mass_kg"], np.array(case["spread"])[3:]
    title = {"paper": "paper's 25 tasks", "poses": "five poses"}[kind] + name.removeprefix(kind)
    if case["tasks_compared"] < stored[kind]["tasks_compared"]:
        title += f"; over {case['tasks_compared']} of them"
    return [
        title,
        f"{totals['own']:.4f}",
        f"{masses['own']:.2f}",
        f"{wrist.mean():.1%}",
        f"{totals['two_step']:.4f}",
        f"{totals['two_step'] / totals['own'] - 1:.2%}",
        f"{masses['two_step']:.2f}",
    ]


def main() -> None:
    """Start the embedded service in a temporary home, measure, store."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", type=int, default=25)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--cases", nargs="+", choices=list(cases(25)), default=list(cases(25)))
    parser.add_argument("--table", action="store_true", help="write the page's tables from what is stored")
    arguments = parser.parse_args()
    stored = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    if arguments.table:
        begin, end = "<!-- figures -->", "<!-- /figures -->"
        before, rest = PAGE.read_text().split(begin)
        PAGE.write_text(f"{before}{begin}\n\n{tables(stored)}\n\n{end}{rest.split(end)[1]}")
        return
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        default_cache().mkdir(parents=True, exist_ok=True)
        (home / "kernels").symlink_to(default_cache())
        settings = Settings(home=home)
        with running_service(settings, Place(workers=arguments.workers)) as service, Client(service.url) as client:
            for name in arguments.cases:
                stored[name] = measure(client, cases(arguments.tasks)[name])
                print(name, json.dumps(stored[name]), flush=True)
                RESULTS.parent.mkdir(exist_ok=True)
                RESULTS.write_text(json.dumps(stored, indent=1) + "\n")


if __name__ == "__main__":
    main()
