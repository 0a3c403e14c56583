"""The paper's 25 tasks from a cold start: every one solves, and no worse than the reference."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from services.codesign import ladder as ladder_module
from services.codesign.solve import solve
from services.codesign.solver import SolverOptions
from tests.numerics.tasks import paper_grid, paper_problem, solved

REFERENCE = json.loads((Path(__file__).parents[1] / "data" / "optima.json").read_text())

PAPERS_FORMULATION = json.loads(
    (Path(__file__).parents[2] / "benchmarks" / "results" / "baseline_optima.json").read_text()
)
"""Shortest times [s] by `benchmarks.baseline`, at tolerance 1e-8."""

FINE = SolverOptions(tol=1e-8)
"""At 1e-6 some 2e-4 of a shortest time is left open, where many motions of the wrist do nearly alike."""

SAME = 1e-4
"""Relative; what lies further apart is another local optimum."""

WORSE_BY = 2e-3
"""Share by which an optimum may be worse than the reference: neighbouring local optima differ by as much."""

BETTER_BY = 2e-2
"""Share by which it may be better: more would mean a limit that is not kept."""


def _cases(table: str) -> list[tuple[float, float, float]]:
    return [(*map(float, key.split(",")), value) for key, value in REFERENCE[table].items()]


@pytest.mark.parametrize(("stroke", "payload", "expected"), _cases("time_s"))
def test_minimum_time(stroke, payload, expected):
    solution = solved(stroke, payload, "time")
    assert expected * (1 - BETTER_BY) < solution.objective < expected * (1 + WORSE_BY)


@pytest.mark.parametrize(("stroke", "payload", "expected"), _cases("energy_V2s_at_1s"))
def test_minimum_energy_in_one_second(stroke, payload, expected):
    solution = solved(stroke, payload, "energy")
    assert expected * (1 - BETTER_BY) < solution.objective < expected * (1 + WORSE_BY)
    assert solution.measures.final_time == pytest.approx(1.0, rel=1e-12)


def test_every_task_solves_for_energy_at_the_first_attempt():
    solutions = [solve(problem) for problem in paper_grid("energy")]
    assert {solution.status for solution in solutions} == {"Solve_Succeeded"}
    assert {len(solution.attempts) for solution in solutions} == {1}
    by_payload = [solutions[k].objective for k in range(5)]
    assert by_payload == sorted(by_payload)


@pytest.mark.parametrize("task", PAPERS_FORMULATION)
def test_no_worse_than_the_papers_formulation(task):
    """It follows the whole central path from a straight line on the task's own grid, ours the end of it alone.

    The same or better in all but 0.4 rad with 2 kg, whose optimum is a neighbour 8e-5 higher.
    """
    stroke, payload = map(float, task.split(","))
    solution = solve(paper_problem(stroke, payload), options=FINE)
    assert solution.status == "Solve_Succeeded"
    assert solution.objective < PAPERS_FORMULATION[task] * (1 + SAME)


def test_every_task_solves_for_time_from_the_quintic_alone(monkeypatch):
    """Without the coarse grid that comes first."""
    monkeypatch.setattr(ladder_module, "_coarse", lambda *_, **__: None)
    solutions = [solve(problem) for problem in paper_grid("time")]
    assert {solution.status for solution in solutions} == {"Solve_Succeeded"}
    assert {tuple(attempt.name for attempt in solution.attempts) for solution in solutions} == {("quintic",)}


def test_the_heaviest_tasks_end_in_better_optima():
    """What the start from a coarse grid is for: 0.15 to 0.26 percent."""
    for payload in (2.0, 3.0, 4.0):
        assert solved(1.0, payload, "time").objective < PAPERS_FORMULATION[f"1.0, {payload}"] * (1 - 1e-3)
