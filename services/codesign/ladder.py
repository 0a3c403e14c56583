"""What is tried, in order, until a solve succeeds.

1. `from 12 intervals`, where only time counts and the dynamic guess takes less than 2 s: that guess on a grid of 12
   intervals, solved for the beginning of the central path; from its motion and motors the task's own grid follows the
   rest, a third fewer iterations there than from the guess itself (docs/performance.md). All 25 tasks of the paper
   solve here. Where the motion found takes more time than the coarse grid's beginning, 5 to 22 percent above the
   optimum of the paper's tasks, `quintic` alone is tried as well, and the better one kept.
2. `quintic`: the dynamic guess with a feasible starting design. Where effort counts too it comes first, and all 25
   tasks solve with it.
3. `slower motion`: the same, stretched in time (where the time is free): far from the voltage limit.
4. `limits kept after all`: the motion and motors that ask least of the limits (`elastic.py`). Where they keep all
   limits the task is solved from there. Where they clearly do not, the ladder ends, and what they break is named: of
   the tasks tried, none that the later rungs could do (docs/performance.md).
5. `strongest motor`: the starting design with the most torque per ampere, for heavy payloads.
6. `from 12 intervals`, unless it was the first.
Of fewer than 24 intervals no coarse grid is made.
A start that is handed in comes before them. What the last rung leaves unsolved goes to `diagnose`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from services.codesign.elastic import ElasticProgram, Unmet, elastic_instance, elastic_start, load_elastic, unmet_limits
from services.codesign.guess import Guess, motion_guess, quintic_guess, starting_design
from services.codesign.instance import Instance, build_instance, scales_of
from services.codesign.motion import read_motion, with_gears_of
from services.codesign.problem import FINAL_TIME_BOUNDS, Problem
from services.codesign.program import Program, program_of
from services.codesign.solution import Attempt, Start
from services.codesign.solver import (
    INTERRUPTED,
    OUT_OF_TIME,
    STOPPED,
    CentralPath,
    Outcome,
    Progress,
    SolverOptions,
    run,
)
from services.codesign.strongest_motor import strongest_motor
from services.codesign.torque_load import torque_load

SLOWER = 2.0
"""Stretch of the motion time on the rung of that name."""

COARSE = 12
"""Intervals of the coarse grid; 8 to 16 do alike."""

ON_COARSE, FROM_COARSE = f"{COARSE} intervals", f"from {COARSE} intervals"
"""Names of the attempt on the coarse grid, and of the one on the task's own that follows it."""

SHORT = 2.0
"""Motion time [s] of the dynamic guess up to which a coarse grid comes first. In what takes longer the arm moves at its
top speed nearly all the time, and the task's own grid is solved from the guess in 13 iterations (docs/performance.md).
"""

MOST_COARSE_ITERATIONS = 100
"""It takes ten, and where both ends lie anywhere up to 60."""

ENDED = (STOPPED, OUT_OF_TIME, INTERRUPTED)
"""Statuses after which nothing more is tried."""

HOPELESS = 2.0
"""Torque load (`torque_load`) above which one failed attempt is enough, on whichever grid."""

CLEARLY = 1e-3
"""Share of a limit that has to give for the ladder to end: ten times what counts as kept."""


@dataclass(frozen=True)
class Climb:
    """The last attempt's outcome and the record of all."""

    outcome: Outcome
    attempts: tuple[Attempt, ...]
    unmet: tuple[Unmet, ...] = ()  # limits that would have to give, largest first; empty where that was not looked for


@dataclass(frozen=True)
class Rung:
    """A name and the start it makes; None when the rung has nothing to offer for this problem."""

    name: str
    start: Callable[[], Guess | None]
    path: CentralPath = CentralPath.WHOLE


@dataclass
class _Climber:
    """A solve under way: runs attempts, keeps their record and the time."""

    options: SolverOptions
    progress: Progress | None
    deadline: float
    attempts: list[Attempt]
    unmet: tuple[Unmet, ...] = ()
    promised: float = np.inf
    """Objective [scaled] of the beginning on a coarse grid, for the paper's tasks 5 to 22 percent above the optimum: an
    answer that is higher still is of another basin."""

    @property
    def is_done(self) -> bool:
        """Whether time is up, a stop was asked for, or a limit has to give by more than a solver leaves open."""
        ended = bool(self.attempts) and self.attempts[-1].status in ENDED
        return ended or any(limit.share > CLEARLY for limit in self.unmet)

    def is_hopeless(self, problem: Problem, program: Program, instance: Instance) -> bool:
        """Whether an attempt has failed for which no motor has the torque by far."""
        return bool(self.attempts) and torque_load(problem, program, instance).share > HOPELESS

    def attempt(
        self,
        name: str,
        program: Program | ElasticProgram,
        instance: Instance,
        start: Guess,
        *,
        path: CentralPath = CentralPath.WHOLE,
        most_iterations: int | None = None,
    ) -> Outcome:
        most = self.options.max_iter if most_iterations is None else min(most_iterations, self.options.max_iter)
        outcome = run(
            program,
            instance,
            start,
            replace(self.options, max_iter=most),
            path=path,
            progress=self.progress,
            attempt=len(self.attempts),
            deadline=self.deadline,
        )
        self.attempts.append(_record(name, outcome))
        return outcome


def climb(
    problem: Problem,
    program: Program,
    instance: Instance,
    start: Guess | Start | None,
    *,
    options: SolverOptions,
    progress: Progress | None,
) -> Climb:
    """Try one rung after another until one succeeds, time is up, or `progress` asks to stop."""
    climber = _Climber(options, progress, time.monotonic() + options.max_wall_time, [])
    outcome: Outcome | None = None
    doubtful: Outcome | None = None
    for rung in _rungs(problem, program, instance, start, climber):
        guess = rung.start()
        tried = None if guess is None else climber.attempt(rung.name, program, instance, guess, path=rung.path)
        outcome = tried or outcome
        is_solved = tried is not None and tried.success
        if is_solved and outcome is not None and outcome.objective > climber.promised:
            doubtful, climber.promised = outcome, np.inf
        elif is_solved or doubtful or climber.is_done or climber.is_hopeless(problem, program, instance):
            break
    if outcome is None:  # ended on the coarse grid
        begin = quintic_guess(problem, program, instance, starting_design(problem))
        outcome = _not_begun(program, begin, climber.attempts[-1])
    if doubtful is not None:
        outcome = _better(doubtful, outcome)
    last = climber.attempts[-1].status
    if last in ENDED and not outcome.success:  # while a rung looked for its start
        outcome = replace(outcome, status=last)
    return Climb(outcome, tuple(climber.attempts), climber.unmet)


def attempt_once(
    name: str,
    program: Program,
    instance: Instance,
    start: Guess,
    *,
    options: SolverOptions,
    progress: Progress | None,
    attempt: int,
    deadline: float,
) -> Climb:
    """One attempt from a point, without a ladder; `attempt` is its number among those of the solve."""
    outcome = run(program, instance, start, options, progress=progress, attempt=attempt, deadline=deadline)
    return Climb(outcome, (_record(name, outcome),))


def _better(first: Outcome, second: Outcome) -> Outcome:
    """Of a success and what was tried after it; who asks for a stop gets no answer."""
    if second.status in (STOPPED, INTERRUPTED):
        return second
    return second if second.success and second.objective < first.objective else first


def _not_begun(program: Program, start: Guess, last: Attempt) -> Outcome:
    """Where a program would have begun, had another one's `last` attempt not ended the solve."""
    return Outcome(
        status=last.status,
        x=start.x,
        lam_x=np.zeros(program.variables),
        lam_g=np.zeros(program.constraints),
        objective=np.nan,
        iterations=last.iterations,
        seconds=last.seconds,
        linear_solver=last.linear_solver,
    )


def _record(name: str, outcome: Outcome) -> Attempt:
    return Attempt(name, outcome.status, outcome.iterations, outcome.seconds, outcome.linear_solver)


def _rungs(
    problem: Problem, program: Program, instance: Instance, start: Guess | Start | None, climber: _Climber
) -> Iterator[Rung]:
    design = starting_design(problem)
    low, high = problem.final_time_bounds
    if start is not None:
        yield Rung("given start", lambda: _given(problem, program, instance, start, design))
    if problem.objective.kind == "time" and low < high:
        yield Rung(
            FROM_COARSE,
            lambda: _coarse(problem, program, instance, design, climber, longest=SHORT),
            CentralPath.END,
        )
    yield Rung("quintic", lambda: quintic_guess(problem, program, instance, design))
    yield Rung("slower motion", lambda: _slower(problem, program, instance, design))
    yield Rung("limits kept after all", lambda: _elastic(problem, program, instance, design, climber))
    yield Rung("strongest motor", lambda: _strongest(problem, program, instance))
    if all(attempt.name != ON_COARSE for attempt in climber.attempts):
        yield Rung(FROM_COARSE, lambda: _coarse(problem, program, instance, design, climber))


def _given(problem: Problem, program: Program, instance: Instance, start: Guess | Start, fallback: np.ndarray) -> Guess:
    if isinstance(start, Guess):
        return start
    design = problem.design if problem.design is not None else start.design
    return motion_guess(problem, program, instance, fallback if design is None else design, start.motion)


def _slower(problem: Problem, program: Program, instance: Instance, design: np.ndarray) -> Guess | None:
    low, high = problem.final_time_bounds
    return None if low == high else quintic_guess(problem, program, instance, design, SLOWER)


def _strongest(problem: Problem, program: Program, instance: Instance) -> Guess | None:
    if problem.design is not None:
        return None
    design = np.tile(strongest_motor(problem.motor), (problem.robot.joints, 1))
    return quintic_guess(problem, program, instance, design)


def _coarse(
    problem: Problem,
    program: Program,
    instance: Instance,
    design: np.ndarray,
    climber: _Climber,
    *,
    longest: float = np.inf,
) -> Guess | None:
    """The motion and motors where a coarse grid's central path begins to follow its end.

    None for few intervals, and where the dynamic guess takes more than `longest` [s].
    """
    if program.intervals < 2 * COARSE:
        return None
    low, high = problem.final_time_bounds
    coarse = replace(
        problem,
        transcription=replace(problem.transcription, intervals=COARSE, widths=None),
        # Fewer intervals need more time.
        objective=replace(problem.objective, final_time_bounds=(low, max(high, FINAL_TIME_BOUNDS[1]))),
    )
    coarse_program = program_of(coarse)
    coarse_instance = build_instance(coarse, coarse_program)
    guess = quintic_guess(coarse, coarse_program, coarse_instance, design)
    if coarse_program.split(guess.x)[1] > longest:
        return None
    outcome = climber.attempt(
        ON_COARSE,
        coarse_program,
        coarse_instance,
        guess,
        path=CentralPath.BEGINNING,
        most_iterations=MOST_COARSE_ITERATIONS,
    )
    if not outcome.success:
        return None
    climber.promised = outcome.objective
    found, _, _ = coarse_program.split(outcome.x)
    motion = read_motion(coarse, coarse_program, outcome.x)
    geared = with_gears_of(problem, coarse_program, outcome.x)  # whose scales its motion has
    x = motion_guess(geared, program, instance, found * scales_of(problem).design, motion).x
    x[program.lengths : program.design_size] = outcome.x[coarse_program.lengths : coarse_program.design_size]
    return Guess(np.clip(x, instance.lower_x, instance.upper_x))


def _elastic(
    problem: Problem, program: Program, instance: Instance, design: np.ndarray, climber: _Climber
) -> Guess | None:
    """The point that asks least of the limits, where that is nothing; else what it asks is remembered."""
    elastic, start = load_elastic(program), quintic_guess(problem, program, instance, design)
    outcome = climber.attempt(
        "elastic limits", elastic, elastic_instance(problem, elastic, instance), elastic_start(elastic, start.x)
    )
    if not outcome.success:
        return None
    x, shares = np.split(outcome.x, [program.variables])
    climber.unmet = unmet_limits(problem, shares)
    return None if climber.unmet else Guess(np.clip(x, instance.lower_x, instance.upper_x))
