"""What is printed: progress as lines, tables with names that people gave, heat maps, exit codes."""

from __future__ import annotations

import io
from typing import Any

import pytest
from rich.console import Console

from armature.cli import tables
from armature.cli.exit_codes import exit_code_of
from armature.cli.heat_map import heat_maps
from armature.cli.reference import Reference
from armature.progress import COMPILING, PlainProgress, current_stage, duration, nothing_to_note
from shared.contracts.comparisons import ComparisonAnswer, MethodTotals, Regret
from shared.contracts.motions import TaskResult
from shared.contracts.states import ApplicationStatus
from shared.domain import ApplicationState

GRID = {"stroke": [0.2, 1.0], "payload_kg": [0.0, 4.0]}


def console() -> tuple[Console, io.StringIO]:
    """A console as it is on a pipe, and what is written to it."""
    written = io.StringIO()
    return Console(file=written, highlight=False, markup=False, width=100), written


def status(done: int, *, state: str = "running", last: dict[str, Any] | None = None) -> ApplicationStatus:
    """An application of four tasks, `done` of which have their co-design."""
    stages = [
        {"name": "codesign", "total": 4, "succeeded": done, "queued": 4 - done},
        {"name": "reconcile", "total": 1},
        {"name": "motions", "total": 4},
    ]
    return ApplicationStatus.model_validate(
        {
            "id": "abc",
            "name": "grid",
            "state": state,
            "reason": None,
            "cancel_requested": False,
            "progress": {"stages": stages, "done": done, "total": 9, "eta_s": 120.0, "last": last, "best": last},
            "objective": {"kind": "time"},
            "method": "two_step",
            "methods": ["two_step"],
            "robot": "ur5",
            "tasks": 4,
            "grid": GRID,
            "excluded_tasks": [],
            "timings": {"solver_time_s": 0, "worker_time_s": 0, "wall_time_s": None},
            "created_at": "2026-01-01T00:00:00+00:00",
            "started_at": None,
            "finished_at": "2026-01-01T00:01:00+00:00" if ApplicationState(state).final else None,
            "tags": [],
            "versions": {},
        }
    )


def comparison(values: dict[str, list[float]], compared: list[int]) -> ComparisonAnswer:
    """A comparison with these final times."""
    own = values["own"]
    return ComparisonAnswer.model_validate(
        {
            "objective": "time",
            "unit": "s",
            "tasks_compared": compared,
            "task_names": [f"task {k} [of four]" for k in compared],
            "task_weights": [1.0] * len(compared),
            "grid": GRID,
            "methods": {
                name: MethodTotals(
                    total_objective=sum(times),
                    weighted_objective=sum(times),
                    worst_objective=max(times),
                    worst_task=compared[times.index(max(times))],
                    total_time_s=sum(times),
                    total_energy_V2s=1.0,
                    total_electrical_energy_J=1.0,
                    total_copper_loss_J=1.0,
                    per_task=[{"objective": time, "final_time_s": time} for time in times],
                    design_mm=None,
                )
                for name, times in values.items()
            },
            "regret": {
                name: Regret(total=sum(times) / sum(own) - 1, per_task=[0.0] * len(times))
                for name, times in values.items()
                if name != "own"
            },
            "missing": {},
        }
    )


def test_limits_come_with_their_units_and_what_a_little_more_would_bring() -> None:
    out, written = console()
    cost = {"name": "current_limit_A", "value": 3.0, "unit": "A", "relax": "raise", "gain_per_unit": 0.0123}
    cost |= {"gain_per_percent": 0.000369, "tasks": [0, 2], "of_the_design": False}
    length = {**cost, "name": "bounds_mm.L.low", "value": 20.0, "unit": "mm", "relax": "lower", "tasks": []}
    found = comparison({"own": [1.0, 2.0, 3.0], "two_step": [1.1, 2.1, 3.1]}, [0, 1, 2])
    limits = {"two_step": [cost, length | {"of_the_design": True}]}
    tables.print_comparison(out, ComparisonAnswer.model_validate(found.model_dump() | {"limits": limits}))
    lines = written.getvalue().splitlines()
    assert any(line.startswith("Limits that hold it back") and "(two_step)" in line for line in lines)
    assert [line.split() for line in lines if "_A" in line] == [
        ["current_limit_A", "3", "A", "raise", "2", "of", "3", "0.0123", "A", "0.000369"]
    ]
    assert [line.split()[4:6] for line in lines if "bounds_mm" in line] == [["the", "design"]]


def test_lines_come_with_news_and_not_with_every_status() -> None:
    out, written = console()
    notes = iter(["compiling", None, None, None])  # none is asked for at the end
    show = PlainProgress(out, lambda: next(notes), every_s=1000.0)
    result = {"task": "t", "task_index": 0, "stage": "codesign", "method": "own", "value": 0.3094, "unit": "s"}
    show(status(0))
    show(status(0))  # the note has gone
    show(status(1, last=result))  # only a count has changed: too soon
    show(status(4, last=result))  # the next stage
    show(status(4, state="cancelled"))
    assert written.getvalue().splitlines() == [
        "co-design, task by task: 0 of 4; compiling",
        "co-design, task by task: 0 of 4; about 2 min left",
        "one design for all tasks: 0 of 1; best 0.3094 s (t); last 0.3094 s (t); about 2 min left",
        "cancelled",
    ]


def test_what_several_starts_found_is_told() -> None:
    """Three of four starts solved, two of them at the best; the other is a quarter worse."""
    run = {"solver_status": "-", "objective": 2.0, "iterations": 1, "solve_time_s": 0.1}
    found = {"solved": 3, "runs": [run] * 4}
    found["ends"] = [{"objective": 2.0, "starts": 2}, {"objective": 2.5, "starts": 1}]
    own = {"objective": 2.0, "final_time_s": 2.0, "energy_V2s": 1, "electrical_energy_J": 1, "copper_loss_J": 1}
    own |= {"recovered_energy_J": [], "peaks": {}, "rms": {}, "certificate": {"kkt_residual": 0.0}, "design_mm": []}
    own |= {"solver_status": "-", "iterations": 1, "solve_time_s": 0.1}
    task = {"index": 0, "name": "t", "payload_kg": 0, "weight": 1, "state": "succeeded", "methods": {}}
    out, written = console()
    tables.print_tasks(out, [TaskResult.model_validate({**task, "own": own})], [], "time")
    assert "spread" not in written.getvalue().lower()
    tables.print_tasks(out, [TaskResult.model_validate({**task, "own": {**own, "starts": found}})], [], "time")
    (row,) = [line.split() for line in written.getvalue().splitlines() if "of 4" in line]
    assert row[-4:] == ["2", "of", "4", "25.00"]


def test_no_time_is_told_while_derivatives_are_compiled() -> None:
    out, written = console()
    show = PlainProgress(out, nothing_to_note, every_s=1000.0)
    compiling = status(0)
    compiling.progress.compiling = True
    show(compiling)
    show(status(0))
    tables.print_status(out, compiling)
    first, second, *shown = written.getvalue().splitlines()
    assert first == f"co-design, task by task: 0 of 4; {COMPILING}"
    assert second == "co-design, task by task: 0 of 4; about 2 min left"
    assert f"  {COMPILING}" in shown
    assert not any("left" in line for line in shown)


def test_the_current_stage_is_the_first_unfinished_one() -> None:
    stage = current_stage(status(4))
    assert stage is not None
    assert stage.name == "reconcile"


@pytest.mark.parametrize(("seconds", "text"), [(0.4, "0 s"), (89, "89 s"), (600, "10 min"), (7200, "2.0 h")])
def test_durations(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_heat_map_has_a_row_a_stroke_and_leaves_out_what_failed() -> None:
    """Task 3 = (stroke 1.0, 4 kg) has no value; the others: 10 percent saved, 20 lost, nothing."""
    answer = comparison({"own": [1, 1, 1], "two_step": [0.9, 1.2, 1.0], "empirical": [1.0, 1.0, 1.0]}, [0, 1, 2])
    ((title, table),) = heat_maps(answer)
    assert title.startswith("two_step against empirical: time saved")
    out, written = console()
    out.print(table)
    rows = [line.split() for line in written.getvalue().splitlines()]
    assert rows[-2:] == [["0.2", "+10.0", "-20.0"], ["1", "+0.0", "-"]]


def test_no_heat_map_without_a_grid() -> None:
    answer = comparison({"own": [1], "two_step": [1], "empirical": [1]}, [0])
    assert list(heat_maps(answer.model_copy(update={"grid": None}))) == []


def test_a_difference_to_the_reference_is_shown_and_explained_above_one_percent() -> None:
    reference = Reference(
        source="elsewhere", unit="s", totals={"own": 2.0, "two_step": 2.0}, explanations={"two_step": "because"}
    )
    out, written = console()
    tables.print_comparison(out, comparison({"own": [1, 1.01], "two_step": [1, 1.2]}, [0, 1]), reference)
    lines = written.getvalue().splitlines()
    assert next(line for line in lines if line.startswith("own")).split()[-2:] == ["2.0000", "+0.50"]
    assert next(line for line in lines if line.startswith("two_step")).split()[-2:] == ["2.0000", "+10.00"]
    explained = [line for line in lines if "differs from the reference" in line]
    assert explained == ["two_step differs from the reference by more than 1 percent: because"]


def test_a_better_method_is_named() -> None:
    out, written = console()
    answer = comparison({"own": [1, 1], "two_step": [1.1, 1.1], "worst_case": [1.0, 1.0]}, [0, 1])
    tables.print_comparison(out, answer)
    assert "worst_case does better than two_step here: with two_step the total is 10.00 percent higher" in (
        written.getvalue()
    )


def test_methods_are_judged_by_what_the_design_is_for() -> None:
    """Two-step has the better total, the worst task is the other way round, and that one was asked for."""
    totals = {"own": [1.0, 1.0], "shared_optimum": [1.2, 1.2], "two_step": [1.0, 1.3]}
    answer = comparison(totals, [0, 1]).model_copy(
        update={"judged": {"own": 2.0, "shared_optimum": 2.4, "two_step": 2.6}}
    )
    out, written = console()
    tables.print_comparison(out, answer)
    assert "does better" not in written.getvalue()
    assert "judged by: what the design is for" in written.getvalue()
    assert next(line for line in written.getvalue().splitlines() if line.startswith("two_step")).split()[1] == "2.6000"


def test_a_better_method_that_does_fewer_tasks_is_called_so() -> None:
    answer = comparison({"own": [1], "shared_optimum": [1.2], "two_step": [1.0]}, [0])
    out, written = console()
    tables.print_comparison(out, answer.model_copy(update={"unsolved": {"two_step": [1, 2]}}))
    assert "But two_step has no motion for 2 tasks that shared_optimum does." in written.getvalue()


def test_a_difference_within_the_tolerance_of_a_solve_is_none() -> None:
    out, written = console()
    tables.print_comparison(out, comparison({"own": [1], "shared_optimum": [1.00001], "two_step": [1.0]}, [0]))
    assert "does better" not in written.getvalue()


def test_names_with_brackets_are_printed_as_they_are() -> None:
    """Rich would take them for its markup."""
    out, written = console()
    task = {"index": 0, "name": "[bold]pick[/]", "payload_kg": 0, "weight": 1, "state": "failed", "methods": {}}
    answer = TaskResult.model_validate({**task, "reason": "too [far]"})
    tables.print_tasks(out, [answer], ["two_step"], "time")
    tables.print_failures(out, [answer], ["two_step"])
    assert written.getvalue().count("[bold]pick[/]") == 2
    assert "no motion at all, left out of the design: too [far]" in written.getvalue()


def test_exit_codes_tell_every_end_apart() -> None:
    codes = {exit_code_of(state) for state in ApplicationState if state.final}
    assert len(codes) == 4
    assert exit_code_of("succeeded") == 0
