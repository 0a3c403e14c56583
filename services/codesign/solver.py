"""One call of IPOPT on a program, with solver objects that live as long as the process.

A solver object depends on the program and the options alone; tasks differ in numbers, so nothing is rebuilt for a
task. IPOPT's linear systems are factorised stage by stage (`staged_ldl`), or by MUMPS where there is no compiler or
that fails. Neither is safe with threads: one solve per process at a time, and a second one is refused.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import casadi as ca
import numpy as np

from services.codesign.elastic import ElasticProgram, elastic_elimination
from services.codesign.elimination import Elimination, elimination
from services.codesign.guess import Guess
from services.codesign.instance import Instance
from services.codesign.interrupts import interrupts_kept, is_interrupted
from services.codesign.kept import Kept
from services.codesign.program import Program
from services.codesign.shared_elimination import shared_elimination
from services.codesign.shared_program import SharedProgram
from services.codesign.staged_ldl import StagedLDL, load_staged_ldl
from services.codesign.tie_break_program import TieBreakProgram, tie_break_elimination

AnyProgram = Program | SharedProgram | ElasticProgram | TieBreakProgram

SOLVED = ("Solve_Succeeded", "Solved_To_Acceptable_Level", "Feasible_Point_Found")
"""Statuses of IPOPT that come with an answer."""

STOPPED = "User_Requested_Stop"
OUT_OF_TIME = "Maximum_WallTime_Exceeded"

INTERRUPTED = "NonIpopt_Exception_Thrown"
"""What IPOPT says when a signal handler raised in the middle of an evaluation; CasADi drops the exception itself."""

LINEAR_ALGEBRA_FAILED = ("Internal_Error", "Error_In_Step_Computation", "Invalid_Option")
"""Statuses after which MUMPS has a try."""

STAGED, MUMPS = "staged", "mumps"
"""Linear solvers by name."""

METIS = 5
"""MUMPS' number for the METIS ordering: 45 percent less time than its own choice (MODEL section 4)."""

WARM_START_BARRIER = 1e-5
"""First barrier parameter of a start with multipliers; IPOPT's 0.1 would throw the start away."""


class CentralPath(Enum):
    """Which part of the central path a solve follows, which IPOPT does from barrier parameter 0.1 down to `tol`."""

    WHOLE = "whole"
    BEGINNING = "beginning"  # from 0.01 towards `BEGINNING_ENDS`, roughly: a point to start another grid from
    END = "end"  # from `END_BEGINS` on, near a point where a beginning ended


BEGINNING_ENDS = 2e-4
END_BEGINS = 1.4e-6

PATHS: dict[CentralPath, dict[str, Any]] = {
    CentralPath.WHOLE: {},
    # Solved roughly, in ten iterations instead of fourteen; the end takes no more for it.
    CentralPath.BEGINNING: {
        "mu_target": BEGINNING_ENDS,
        "mu_init": 1e-2,
        "barrier_tol_factor": 100.0,
        "tol": 100 * BEGINNING_ENDS,
        "dual_inf_tol": 10.0,
        "constr_viol_tol": 10.0,
        "compl_inf_tol": 10.0,
    },
    # Multipliers of bounds start between those of active bounds and those of the others: 1, which IPOPT begins with, is
    # right for a barrier of 0.1, and barrier over distance takes seven iterations more (docs/performance.md).
    # A last barrier of tol / 21 instead of tol / 11 leaves half as much of the optimum open.
    # Where curvature is negative, little more perturbation is added than takes it away: with a factor of 4 two of the
    # paper's 25 tasks end in a neighbouring optimum, 1e-4 higher.
    CentralPath.END: {
        "mu_init": END_BEGINS,
        "barrier_tol_factor": 20.0,
        "bound_mult_init_val": 2e-3,
        "bound_push": BEGINNING_ENDS,
        "bound_frac": BEGINNING_ENDS,
        "slack_bound_push": BEGINNING_ENDS,
        "slack_bound_frac": BEGINNING_ENDS,
        "perturb_inc_fact": 1.7,
    },
}
"""IPOPT's options for each, chosen over the 25 tasks of the paper, those of another arm and random ones."""

SHARED_BARRIER = {"barrier_tol_factor": 1e3, "mu_target": 1e-7, "kappa_sigma": 1e5}
"""For the program of all tasks, whose motions with time to spare leave directions flat: each barrier problem is solved
only roughly, and the last barrier parameter is approached and kept (docs/decisions/0005, which says what it saves)."""

EXPECT_INFEASIBLE = {"expect_infeasible_problem": "yes"}
"""Multipliers above 1e8, while constraints are broken by more than 1e-3, start the restoration phase. Else a task that
cannot be done goes on with a hundred systems regularised by 1e8 and more, which no elimination does well; one that can
be done is solved as before, iteration by iteration (docs/performance.md)."""


@dataclass(frozen=True)
class SolverOptions:
    """What a caller may choose about a solve."""

    tol: float = 1e-6
    max_iter: int = 500  # of one attempt
    max_wall_time: float = 120.0  # s, of all attempts together
    threads: int = 1  # of the program of all tasks; a single task's runs on one


@dataclass(frozen=True)
class IterationReport:
    """What the solver tells while it runs."""

    attempt: int  # 0, 1, ... along the ladder
    iteration: int  # of this attempt
    objective: float  # the program's, scaled


Progress = Callable[[IterationReport], bool]
"""Called at every iteration; True asks the solver to stop."""


def counted_from(first: int, progress: Progress | None) -> Progress | None:
    """The same, with attempts numbered on from `first`, for a solve that comes after others of a job."""
    if progress is None:
        return None
    return lambda report: progress(replace(report, attempt=first + report.attempt))


@dataclass(frozen=True)
class Outcome:
    """What IPOPT left behind."""

    status: str
    x: np.ndarray
    lam_x: np.ndarray
    lam_g: np.ndarray
    objective: float  # the program's, scaled
    iterations: int
    seconds: float
    linear_solver: str  # STAGED or MUMPS

    @property
    def success(self) -> bool:
        """Whether x is an answer."""
        return self.status in SOLVED


OBJECTIVE = 1
"""Which of a solver's outputs it is."""


class _Monitor(ca.Callback):
    """IPOPT's iteration callback: reports, and stops the solve when asked to, when time is up or on an exception.

    CasADi hands it the objective alone, without a copy: the rest is declared empty.
    """

    def __init__(self) -> None:
        ca.Callback.__init__(self)
        self.construct("monitor")
        self.begin(None, 0, np.inf)

    def begin(self, progress: Progress | None, attempt: int, deadline: float) -> None:
        self.progress, self.attempt, self.deadline = progress, attempt, deadline
        self.iteration = 0
        self.stopped_as: str | None = None
        self.error: BaseException | None = None

    def get_n_in(self) -> int:
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, i: int) -> Any:
        return ca.Sparsity.dense(int(i == OBJECTIVE), 1)

    def has_eval_buffer(self) -> bool:
        return True

    def eval_buffer(self, arg: Sequence[memoryview], res: Sequence[memoryview]) -> int:
        try:
            objective = arg[OBJECTIVE].cast("d")[0]
            report = IterationReport(self.attempt, self.iteration, objective)
            asked = self.progress is not None and self.progress(report)
            if asked or is_interrupted():
                self.stopped_as = STOPPED
            elif time.monotonic() > self.deadline:
                self.stopped_as = OUT_OF_TIME
        except BaseException as error:  # CasADi would swallow it; `run` raises it again once IPOPT has returned
            self.error = error
        if self.error is not None:
            self.stopped_as = STOPPED
        self.iteration += 1
        res[0].cast("d")[0] = float(self.stopped_as is not None)
        return 0


@dataclass(frozen=True)
class _Solver:
    program: AnyProgram  # kept, so that its id stays its own
    function: ca.Function
    monitor: _Monitor


MOST_SOLVERS = 12
"""Kept in a process, each with IPOPT's work space."""

_SOLVERS: Kept[_Solver] = Kept(MOST_SOLVERS)
_BUSY = threading.Lock()


def run(
    program: AnyProgram,
    instance: Instance,
    start: Guess,
    options: SolverOptions,
    *,
    path: CentralPath = CentralPath.WHOLE,
    progress: Progress | None = None,
    attempt: int = 0,
    deadline: float = np.inf,
) -> Outcome:
    """Run IPOPT once.

    Parameters
    ----------
    start
        With `lam_x` and `lam_g` it is a warm start: IPOPT keeps to the point and begins with a small barrier.
    deadline
        Value of `time.monotonic` at which to stop, if that comes before `options.max_wall_time` is over.

    Raises
    ------
    RuntimeError
        When another solve runs in this process.
    BaseException
        Whatever `progress` raised.
    """
    if not _BUSY.acquire(blocking=False):
        raise RuntimeError("a solve is running in this process already: the linear algebra is not safe with threads")
    try:
        staged = load_staged_ldl()
        watch = (progress, attempt, deadline)
        outcome = _run_with(staged, program, instance, start, options, path=path, watch=watch)
        failed = staged is not None and (staged.refused or outcome.status in LINEAR_ALGEBRA_FAILED)
        if failed and outcome.status not in (STOPPED, OUT_OF_TIME):
            outcome = _run_with(None, program, instance, start, options, path=path, watch=watch)
        return outcome
    finally:
        _BUSY.release()


def _run_with(
    staged: StagedLDL | None,
    program: AnyProgram,
    instance: Instance,
    start: Guess,
    options: SolverOptions,
    *,
    path: CentralPath,
    watch: tuple[Progress | None, int, float],
) -> Outcome:
    """Run IPOPT with our factorisation, or with MUMPS when there is none."""
    warm = start.lam_x is not None and start.lam_g is not None
    solver = _solver(program, options, warm, path, staged)
    progress, attempt, deadline = watch
    solver.monitor.begin(progress, attempt, min(deadline, time.monotonic() + options.max_wall_time))
    if staged is not None:
        staged.hand_over(_order(program, instance), options.threads if _of_all_tasks(program) else 1)
    began = time.perf_counter()
    with interrupts_kept():
        result = solver.function(**_arguments(instance, start))
    seconds = time.perf_counter() - began
    stats = solver.function.stats()
    if solver.monitor.error is not None:
        raise solver.monitor.error
    return Outcome(
        status=solver.monitor.stopped_as or str(stats["return_status"]),
        x=result["x"].full().ravel(),
        lam_x=result["lam_x"].full().ravel(),
        lam_g=result["lam_g"].full().ravel(),
        objective=float(result["f"]),
        iterations=int(stats["iter_count"]),
        seconds=seconds,
        linear_solver=MUMPS if staged is None else STAGED,
    )


def _of_all_tasks(program: AnyProgram) -> bool:
    """Whether it is the program of all tasks, or its tie-break's."""
    return isinstance(program.base if isinstance(program, TieBreakProgram) else program, SharedProgram)


def _order(program: AnyProgram, instance: Instance) -> Elimination:
    if isinstance(program, SharedProgram):
        return shared_elimination(program, instance)
    if isinstance(program, TieBreakProgram):
        return tie_break_elimination(program, instance)
    if isinstance(program, ElasticProgram):
        return elastic_elimination(program, instance)
    return elimination(program, instance)


def _arguments(instance: Instance, start: Guess) -> dict[str, np.ndarray]:
    numbers = {
        "x0": start.x,
        "p": instance.parameters,
        "lbx": instance.lower_x,
        "ubx": instance.upper_x,
        "lbg": instance.lower_g,
        "ubg": instance.upper_g,
    }
    if start.lam_x is not None and start.lam_g is not None:
        numbers |= {"lam_x0": start.lam_x, "lam_g0": start.lam_g}
    return numbers


def _solver(
    program: AnyProgram, options: SolverOptions, warm: bool, path: CentralPath, staged: StagedLDL | None
) -> _Solver:
    key = (id(program), options.tol, options.max_iter, warm, path, MUMPS if staged is None else str(staged.path))

    def make() -> _Solver:
        monitor = _Monitor()
        casadi_options = _casadi_options(program, options, warm, path, staged=staged, monitor=monitor)
        return _Solver(program, ca.nlpsol("solve", "ipopt", program.nlp, casadi_options), monitor)

    return _SOLVERS.get(key, make)


def _casadi_options(
    program: AnyProgram,
    options: SolverOptions,
    warm: bool,
    path: CentralPath,
    *,
    staged: StagedLDL | None,
    monitor: _Monitor,
) -> dict[str, Any]:
    ipopt: dict[str, Any] = {
        "tol": options.tol,
        "max_iter": options.max_iter,
        "min_refinement_steps": 0,  # a solution is refined when its residual asks for it
        "print_level": 0,
        "sb": "yes",
        **({"mumps_pivot_order": METIS} if staged is None else staged.ipopt_options),
    }
    if _of_all_tasks(program):
        ipopt |= SHARED_BARRIER
    if isinstance(program, Program):
        ipopt |= EXPECT_INFEASIBLE
    ipopt |= PATHS[path]
    if warm:
        ipopt |= {
            "warm_start_init_point": "yes",
            "mu_init": WARM_START_BARRIER,
            "warm_start_bound_push": WARM_START_BARRIER,
            "warm_start_mult_bound_push": WARM_START_BARRIER,
            "warm_start_slack_bound_push": WARM_START_BARRIER,
        }
    return {
        "grad_f": program.grad_f,
        "jac_g": program.jac_g,
        "hess_lag": program.hess_lag,
        # Else CasADi differentiates the whole program once more, for multipliers that nobody asks for.
        "no_nlp_grad": True,
        "calc_lam_p": False,
        "iteration_callback": monitor,
        "print_time": False,
        "error_on_fail": False,
        "ipopt": ipopt,
    }
