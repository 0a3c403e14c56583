"""The optima of the paper's formulation and ours over its 25 tasks, at tolerance 1e-8.

    python -m benchmarks.baseline_optima [--again]

The baseline takes a quarter of an hour, and what it finds does not change with ours: it is kept in
results/baseline_optima.json, and only found anew with `--again`.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from benchmarks.baseline import Baseline
from benchmarks.solve_time import PAYLOADS, STROKES, paper_problem
from benchmarks.tables import put, table
from services.codesign.solve import solve
from services.codesign.solver import SolverOptions

KEPT = Path(__file__).parent / "results" / "baseline_optima.json"
TASKS = [(stroke, payload) for stroke in STROKES for payload in PAYLOADS]
FINE = 1e-8
SAME = 1e-4
"""Relative; what lies further apart is another local optimum."""


def find_theirs() -> dict[str, float]:
    """The baseline's shortest times [s], by "stroke [rad], payload [kg]"; without a task that it does not solve."""
    baseline = Baseline(paper_problem(*TASKS[0]))
    runs = {f"{stroke}, {payload}": baseline.solve(paper_problem(stroke, payload), FINE) for stroke, payload in TASKS}
    return {task: run.objective for task, run in runs.items() if run.success}


def find_ours() -> dict[str, float]:
    """Ours, of all tasks."""
    found = {}
    for stroke, payload in TASKS:
        solution = solve(paper_problem(stroke, payload), options=SolverOptions(tol=FINE))
        assert solution.objective is not None, solution.reason
        found[f"{stroke}, {payload}"] = solution.objective
    return found


def compared(theirs: dict[str, float], ours: dict[str, float]) -> str:
    """How many are the same, and each that is not."""
    apart = {task: ours[task] / theirs[task] - 1 for task in theirs}
    same = sum(abs(share) <= SAME for share in apart.values())
    rows = [[f"the same within {SAME:g}: {same} of {len(theirs)}", "", "", f"{max(apart.values()):+.3%} at most"]]
    for task, share in sorted(apart.items(), key=lambda item: item[1]):
        if abs(share) > SAME:
            stroke, payload = map(float, task.split(","))
            rows.append([f"{stroke} rad, {payload:g} kg", f"{theirs[task]:.6f}", f"{ours[task]:.6f}", f"{share:+.3%}"])
    rows.append(["sum of all", f"{sum(theirs.values()):.4f}", f"{sum(ours[task] for task in theirs):.4f}", ""])
    return table(["task", "paper's formulation s", "ours s", "apart"], rows)


def main() -> None:
    """Solve, and write the section of docs/performance.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--again", action="store_true", help="find the baseline's optima anew")
    if parser.parse_args().again or not KEPT.exists():
        KEPT.write_text(json.dumps(find_theirs(), indent=1) + "\n", encoding="utf-8")
    put("optima", compared(json.loads(KEPT.read_text(encoding="utf-8")), find_ours()))


if __name__ == "__main__":
    main()
