"""Bars in a notebook: one output, replaced with every status, with the numbers in words too."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import httpx
import pytest

from armature import Client, notebook, progress

STATUS: dict[str, Any] = {
    "id": "abc", "name": "<b>a</b>", "state": "running", "reason": None, "cancel_requested": False,
    "progress": {
        "stages": [
            {"name": "codesign", "total": 25, "succeeded": 7, "failed": 1},
            {"name": "reconcile", "total": 1},
        ],
        "done": 8, "total": 26, "eta_s": 61.0,
        "best": {"task": "<i>x", "task_index": 0, "stage": "codesign", "method": "own", "value": 0.5, "unit": "s"},
    },
    "objective": {"kind": "time"}, "method": "two_step", "methods": ["two_step"], "robot": "ur5", "tasks": 25,
    "grid": None, "excluded_tasks": [], "timings": {"solver_time_s": 1, "worker_time_s": 1, "wall_time_s": None},
    "created_at": "", "started_at": "", "finished_at": None, "tags": [], "versions": {},
}  # fmt: skip


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, str]]:
    """What IPython was asked to show, first and then in its place."""
    contents: list[dict[str, str]] = []

    def display(content: dict[str, str], *, raw: bool, display_id: bool) -> Any:
        assert raw
        assert display_id
        contents.append(content)
        return SimpleNamespace(update=lambda content, raw: contents.append(content))

    module = ModuleType("IPython.display")
    module.display = display  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "IPython.display", module)
    monkeypatch.setattr(progress, "in_notebook", lambda: True)
    return contents


def test_a_wait_shows_bars_in_a_notebook(shown: list[dict[str, str]]) -> None:
    """One output that is replaced, with what people typed as text."""
    answers = iter([STATUS, STATUS | {"state": "succeeded", "finished_at": "2026-01-01T00:00:00+00:00"}])
    transport = httpx.MockTransport(lambda _: httpx.Response(200, json=next(answers)))
    with Client(transport=transport) as client:
        assert client.application("abc").wait(progress=True, poll_s=0.0).state == "succeeded"
    first, last = shown
    assert '<progress value="8" max="25" aria-label="co-design, task by task">' in first["text/html"]
    assert "8 of 25 (1 failed)" in first["text/plain"]
    assert "about 61 s left" in first["text/html"]
    assert "<i>" not in first["text/html"]
    assert "succeeded" in last["text/plain"]


def test_a_terminal_is_no_notebook() -> None:
    assert not notebook.in_notebook()
