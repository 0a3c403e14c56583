"""Among designs that are equal but for a stated tolerance, one that is chosen: the lightest, or the nearest.

Many tasks leave some lengths free: the magnets of a wrist's motors may be 40 percent higher at the same minimum time.
Which of them a solver returns is an accident, and the mean over tasks then averages accidents.
"""

from __future__ import annotations

from dataclasses import replace

from services.codesign.guess import Guess
from services.codesign.instance import Instance, scales_of
from services.codesign.ladder import Climb
from services.codesign.problem import Problem
from services.codesign.program import Program
from services.codesign.shared_program import SharedProgram
from services.codesign.solution import Attempt
from services.codesign.solver import Outcome, Progress, SolverOptions, run
from services.codesign.tie_break_program import tie_break_program


def break_tie(
    problem: Problem,
    program: Program,
    instance: Instance,
    found: Climb,
    *,
    options: SolverOptions,
    progress: Progress | None,
) -> Climb:
    """The optimum of a task that was found, moved to the preferred design of those within the tolerance.

    Where that solve fails the optimum stays as it was, and the attempt says so.
    """
    tie_break = problem.tie_break
    if tie_break is None:
        return found
    count = len(found.attempts)
    tried = preferred(problem, program, instance, found.outcome, options=options, progress=progress, attempt=count)
    name = "tie-break: lightest" if tie_break.nearest_to is None else "tie-break: nearest"
    attempt = Attempt(name, tried.status, tried.iterations, tried.seconds, tried.linear_solver)
    return Climb(tried if tried.success else found.outcome, (*found.attempts, attempt))


def preferred(
    problem: Problem,
    program: Program | SharedProgram,
    instance: Instance,
    optimum: Outcome,
    *,
    options: SolverOptions,
    progress: Progress | None,
    attempt: int = 1,
) -> Outcome:
    """The point with the preferred design among those whose objective is within the tolerance of the optimum's.

    As an outcome of the program itself: its multipliers are those of the second question over the objective's, so that
    they still are slopes of the objective in its limits. Where the objective has none, for the lightest design of all
    is as good, the optimum is returned.
    """
    tie_break, second = problem.tie_break, tie_break_program(program)
    assert tie_break is not None
    bound = optimum.objective + tie_break.tolerance * abs(optimum.objective)
    target = None if tie_break.nearest_to is None else tie_break.nearest_to / scales_of(problem).design
    outcome = run(
        second,
        second.instance(instance, bound, target),
        Guess(optimum.x),
        options,
        progress=progress,
        attempt=attempt,
    )
    price = float(outcome.lam_g[-1])
    if outcome.success and price <= 0:
        return optimum
    f, multipliers = float(program.nlp(outcome.x, instance.parameters)[0]), outcome.lam_g[:-1]
    return replace(outcome, objective=f, lam_x=outcome.lam_x / (price or 1.0), lam_g=multipliers / (price or 1.0))
