"""The quintic guess takes the shortest time in which its motors can follow it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from services.codesign.guess import TIME_SEARCH_POINTS, motor_demand, quintic, quintic_guess, starting_design
from services.codesign.instance import build_instance, scales_of
from services.codesign.problem import Problem
from services.codesign.program import program_of
from tests.numerics.tasks import paper_problem


def guessed_time(problem: Problem) -> float:
    program = program_of(problem)
    start = quintic_guess(problem, program, build_instance(problem, program), starting_design(problem))
    return float(start.x[program.time_index])


def load(problem: Problem, final_time: float) -> float:
    """Largest share of a speed, current or voltage limit that the quintic takes."""
    program, share = program_of(problem), np.linspace(0, 1, TIME_SEARCH_POINTS)
    instance, design = build_instance(problem, program), starting_design(problem)
    motion = quintic(problem, final_time, share)
    demand = motor_demand(problem, program, instance, design, motion)
    return float(max(np.abs(part).max() for part in (motion[1] / scales_of(problem).speed, *demand)))


@pytest.mark.parametrize("payload", [0.0, 2.0, 4.0])
@pytest.mark.parametrize("stroke", [1e-6, 0.05, 0.6, 2.0])
def test_the_shortest_time_that_the_limits_allow(stroke, payload):
    problem = paper_problem(stroke, payload)
    found = guessed_time(problem)
    assert load(problem, found) <= 1
    assert found == problem.final_time_bounds[0] or load(problem, 0.9999 * found) > 1


def test_a_motion_that_starts_fast():
    """Its load does not fall with a power of time; the time found is one that fits, and a little less does not."""
    problem = paper_problem(0.6, 2.0)
    problem = replace(problem, task=replace(problem.task, start_speed=np.full(6, -1.0)))
    found = guessed_time(problem)
    assert load(problem, found) <= 1
    assert load(problem, 0.9999 * found) > 1


def test_a_payload_beyond_the_arm():
    """No time will do: twice the time that the speeds ask for, within the bounds."""
    problem = paper_problem(0.6, 500.0)
    low, high = problem.final_time_bounds
    longest = np.abs(problem.task.end - problem.task.start) / scales_of(problem).speed
    assert guessed_time(problem) == pytest.approx(np.clip(2 * longest.max(), low, high))
