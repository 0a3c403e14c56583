"""Why a task cannot be done, in a sentence with numbers, units, the joint and the limit."""

from __future__ import annotations

from services.codesign.instance import Instance
from services.codesign.problem import Problem
from services.codesign.program import Program
from services.codesign.solver import Outcome


def impossible(_problem: Problem) -> str | None:
    """A proven obstacle, from necessary conditions that need no solve; None when there is none."""
    return None


def explain_failure(_problem: Problem, _program: Program, _instance: Instance, outcome: Outcome) -> str:
    """What most likely stands in the way of a task whose solve failed."""
    return f"the solver gave up with {outcome.status}"
