"""What a solve returns: an answer with what it took to find it, or a failure with the reason. Both are values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from services.codesign.measures import Measures
from services.codesign.motion import Motion
from services.codesign.problem import Problem

NOT_ATTEMPTED = "Infeasible_By_Inspection"
"""Status, beside IPOPT's own, of a task that a necessary condition rules out before any solve."""


@dataclass(frozen=True)
class Attempt:
    """One call of the solver."""

    name: str  # what was tried, in words
    status: str  # IPOPT's return_status
    iterations: int
    seconds: float
    linear_solver: str  # "staged", or "mumps" where that cannot be had


@dataclass(frozen=True)
class Start:
    """A known motion to start a solve from, on any grid; `design` (n, 7) [m] when the problem leaves it free."""

    motion: Motion
    design: np.ndarray | None = None


@dataclass(frozen=True)
class Solution:
    """The answer to one problem. `design`, `motion`, `measures` and `objective` are None when it failed.

    So a failed task cannot enter a mean unnoticed. `x`, `lam_x`, `lam_g` are the point where the solver ended, in
    the program's scaled units, for export and diagnosis; None when nothing was attempted.
    """

    problem: Problem  # as solved: with its objective's references filled in
    success: bool
    status: str
    reason: str | None  # why it failed, for people; None on success
    design: np.ndarray | None  # (n, 7) m
    motion: Motion | None
    measures: Measures | None
    objective: float | None  # t_f [s], integral of u'u [V2 s], electrical energy [J], or the weighted sum
    iterations: int  # of all attempts
    solve_time: float  # s, wall, from the guess to the answer, all attempts included
    attempts: tuple[Attempt, ...]
    kkt_residual: float  # by `optimality`, from the program's functions; NaN when nothing was attempted
    constraint_violation: float  # scaled: 1 is about one limit
    x: np.ndarray | None
    lam_x: np.ndarray | None
    lam_g: np.ndarray | None

    @property
    def start(self) -> Start:
        """This solution as a start for a neighbouring problem.

        Raises
        ------
        ValueError
            For a failed solve.
        """
        if self.motion is None:
            raise ValueError(f"a failed solve ({self.status}) is no start")
        return Start(self.motion, self.design)
