"""What a process keeps is bounded, and what was let go comes back the same."""

from __future__ import annotations

import gc
import weakref
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Barrier

import pytest

from services.codesign import program as program_module
from services.codesign import solver as solver_module
from services.codesign.kept import Kept
from services.codesign.problem import Problem, Transcription
from services.codesign.program import Program, load_program
from services.codesign.solve import solve
from tests.numerics.tasks import paper_problem

GRIDS = (8, 9, 10)


def on(intervals: int) -> Problem:
    return replace(paper_problem(0.2, 0.0), transcription=Transcription(intervals=intervals))


def program_of(problem: Problem) -> Program:
    return load_program(problem.robot, problem.layout, problem.transcription.intervals)


def test_the_last_used_are_kept() -> None:
    made: list[int] = []
    kept: Kept[int] = Kept(2)

    def ask(key: int) -> int:
        return kept.get(key, lambda: made.append(key) or key * key)  # type: ignore[func-returns-value]

    assert [ask(key) for key in (1, 2, 1, 3, 1, 2)] == [1, 4, 1, 9, 1, 4]
    assert made == [1, 2, 3, 2], "2 was used longest ago when 3 came"
    assert len(kept) == 2


def ask(kept: Kept[str], key: str) -> bool:
    """Whether a value, which is its key, was kept."""
    made: list[str] = []
    assert kept.get(key, lambda: made.append(key) or key) == key  # type: ignore[func-returns-value]
    return not made


def test_so_much_is_kept_as_weighs_the_most_together() -> None:
    kept: Kept[str] = Kept(7, weight=len)
    assert [ask(kept, key) for key in ("aaa", "bbb", "aaa", "ccc", "aaa", "ccc", "bbb")] == [
        *(False, False, True, False, True, True, False)
    ]
    assert not ask(kept, "aaa"), "it was asked for longest ago when bbb came back"


def test_one_that_weighs_more_is_kept_alone() -> None:
    kept: Kept[str] = Kept(2, weight=len)
    assert [ask(kept, key) for key in ("aaa", "aaa", "bbb", "aaa")] == [False, True, False, False]
    assert len(kept) == 1


def test_a_value_may_ask_for_another_of_the_same_kind() -> None:
    kept: Kept[int] = Kept(2)
    assert kept.get("outer", lambda: kept.get("inner", lambda: 1) + 1) == 2
    assert kept.get("inner", lambda: 0) == 1


def test_two_threads_that_make_a_value_at_once_get_the_same() -> None:
    kept: Kept[object] = Kept(1)
    both = Barrier(2, timeout=60)

    def make() -> object:
        both.wait()  # neither has stored it yet
        return object()

    with ThreadPoolExecutor(2) as threads:
        first, second = [future.result() for future in [threads.submit(kept.get, "key", make) for _ in range(2)]]
    assert first is second
    assert len(kept) == 1


def test_solvers_and_programs_of_many_grids_are_let_go_and_solve_the_same_again(monkeypatch) -> None:
    monkeypatch.setattr(program_module, "_PROGRAMS", Kept(1))
    monkeypatch.setattr(solver_module, "_SOLVERS", solvers := Kept(1))
    first = solve(on(GRIDS[0]))
    earlier = weakref.ref(program_of(on(GRIDS[0])))
    for intervals in GRIDS[1:]:
        assert solve(on(intervals)).success
    assert len(solvers) == 1
    gc.collect()
    assert earlier() is None, "something else keeps the program of a grid that is no longer used"
    again = solve(on(GRIDS[0]))
    assert again.success
    assert again.iterations == first.iterations
    assert again.objective == pytest.approx(first.objective, rel=1e-12)
