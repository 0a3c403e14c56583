"""The time-energy front shows the totals of a sweep, and only those that compare."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from services.report.front_chart import front_chart, has_front
from services.report.style import style
from shared.contracts.sweeps import SweepStatus, SweepTotals


@pytest.fixture(autouse=True)
def project_style() -> Iterator[None]:
    with style():
        yield


def totals(time: float, energy: float, tasks: int = 2) -> SweepTotals:
    return SweepTotals(
        tasks=tasks,
        objective=1.0,
        weighted_objective=1.0,
        worst_objective=1.0,
        time_s=time,
        energy_V2s=energy,
        electrical_energy_J=1.0,
    )


def sweep(*points: tuple[dict[str, Any], dict[str, SweepTotals]]) -> SweepStatus:
    """Points of two tasks each."""
    about = {"application_id": "a", "state": "succeeded", "reason": None, "objective": "weighted", "unit": "1"}
    return SweepStatus.model_validate(
        {
            "id": "s",
            "name": "front",
            "state": "succeeded",
            "created_at": "",
            "tags": [],
            "axes": {axis: [] for axis in points[0][0]},
            "counts": {},
            "dimensions": [],
            "points": [
                about
                | {"position": k, "values": values, "method": "two_step", "tasks": 2, "totals": found, "designs_mm": {}}
                for k, (values, found) in enumerate(points)
            ],
        }
    )


def test_one_line_along_alpha_for_each_value_of_the_other_axis() -> None:
    points = [
        ({"objective.alpha": alpha, "robot_changes.gear_ratio": gear}, {"two_step": totals(gear + alpha, 10 - alpha)})
        for alpha in (0.5, 0.0)
        for gear in (80, 100)
    ]
    (axes,) = front_chart(sweep(*points)).axes
    drawn = {str(line.get_label()): np.asarray(line.get_xydata()).tolist() for line in axes.lines}
    assert drawn["two-step, gear_ratio 80"] == [[80, 10], [80.5, 9.5]]
    assert drawn["two-step, gear_ratio 100"] == [[100, 10], [100.5, 9.5]]
    assert [text.get_text() for text in axes.texts if text.get_text()] == ["α = 0", "α = 0.5"]


def test_totals_over_fewer_tasks_are_left_out() -> None:
    points = sweep(
        ({"objective.alpha": 0.0}, {"two_step": totals(1, 9), "own": totals(0.9, 8)}),
        ({"objective.alpha": 0.3}, {"two_step": totals(2, 5), "own": totals(0.5, 4, tasks=1)}),
        ({"objective.alpha": 0.6}, {"two_step": totals(0.1, 1, tasks=1)}),
    )
    assert has_front(points)
    (axes,) = front_chart(points).axes
    drawn = {str(line.get_label()): np.asarray(line.get_xydata()).tolist() for line in axes.lines}
    assert drawn == {"two-step": [[1, 9], [2, 5]], "own design per task": [[0.9, 8]]}


def test_no_front_without_alpha_or_with_one_point() -> None:
    assert not has_front(sweep(({"motor.turns_per_tooth": 40}, {"two_step": totals(1, 2)}), ({}, {})))
    assert not has_front(sweep(({"objective.alpha": 0.1}, {"two_step": totals(1, 2)})))
