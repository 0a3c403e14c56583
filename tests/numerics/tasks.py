"""The paper's tasks on the default arm, and their solutions, each solved once for all tests."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from services.codesign.problem import Objective, Problem, Task
from services.codesign.robot import Robot
from services.codesign.solve import Solution, solve

STROKES = (0.2, 0.4, 0.6, 0.8, 1.0)
PAYLOADS = (0.0, 1.0, 2.0, 3.0, 4.0)
UR5 = Robot.preset("ur5")


def paper_task(stroke: float, payload: float, duration: float = 1.0) -> Task:
    return Task(np.full(6, stroke), np.zeros(6), payload, duration=duration)


def paper_problem(stroke: float, payload: float, kind: str = "time", alpha: float = 0.0, **changes) -> Problem:
    return Problem(UR5, paper_task(stroke, payload), objective=Objective(kind, alpha), **changes)


def paper_grid(kind: str) -> list[Problem]:
    """25 tasks, payload running faster, as in the paper."""
    return [paper_problem(stroke, payload, kind) for stroke in STROKES for payload in PAYLOADS]


@lru_cache(maxsize=64)
def solved(stroke: float, payload: float, kind: str = "time", alpha: float = 0.0) -> Solution:
    return solve(paper_problem(stroke, payload, kind, alpha))
