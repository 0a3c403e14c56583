"""Run one job: the numerics between what was read from the database and what will be written to it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from services.codesign.accuracy import solve_accurately
from services.codesign.certify import Certificate, certify
from services.codesign.guess import Guess, point_guess
from services.codesign.limits import binding, limit_slopes
from services.codesign.measures import Load, Measures
from services.codesign.problem import Accuracy, Problem
from services.codesign.program import program_of
from services.codesign.reconcile import mean_design, project_design
from services.codesign.solution import Solution
from services.codesign.solve import SolverOptions, with_references
from services.codesign.solver import STOPPED, IterationReport, Progress
from services.codesign.starts import StartRun, ends, solve_from_starts
from services.jobs.arrays import pack
from services.jobs.certificates import certificate_wire, energies_wire, finite, input_hash, missed, refinement_wire
from services.jobs.design_wire import design_mm, design_wire, gears_wire
from services.jobs.find_shared_optimum import find_shared_optimum
from services.jobs.finish import Outcome
from services.jobs.limit_costs import limits_wire
from services.jobs.resolved import CATALOGUE
from services.jobs.snap_design import snapped_designs
from services.jobs.work import Work
from shared.domain import JobState, Stage

MOST_LOG_LINES = 2000
"""Solver iterations kept of one job: the last ones."""


def execute(
    work: Work, options: SolverOptions, progress: Progress, search_stopped: Callable[[], bool] = lambda: False
) -> Outcome:
    """Do a job's work; `progress` is called at every solver iteration and stops the solve when it returns True.

    `search_stopped` tells whether a search is to end with the best that it has.
    """
    if work.spec.stage == Stage.RECONCILE:
        return _reconcile(work)
    if work.spec.stage == Stage.SHARED_OPTIMUM:
        return find_shared_optimum(work, options, progress, search_stopped)
    problem = work.application.build_problem(work.spec.task_index, work.design, work.gear_ratio)
    if work.references is not None:
        problem = with_references(problem, work.references)
    log: deque[tuple[int, int, float]] = deque(maxlen=MOST_LOG_LINES)

    def watched(report: IterationReport) -> bool:
        log.append((report.attempt, report.iteration, report.objective))
        return progress(report)

    # Cold, but for the shared optimum's motions: the ladder's start beats the task's own motion for other motors
    # (docs/performance.md).
    outcome = _as_it_is if work.application.accuracy is None else _accurate
    return replace(outcome(work, problem, options, watched), log=tuple(log))


def _as_it_is(work: Work, problem: Problem, options: SolverOptions, progress: Progress) -> Outcome:
    """A transcription that was asked for: solved as it is, and marked when the replay misses the default accuracy."""
    found = solve_from_starts(problem, work.application.starts, options, progress, _known(work, problem))
    solution = found.solution
    if not solution.success:
        return _failed(solution)
    certificate = certify(solution)
    wire = certificate_wire(certificate, Accuracy(), solution.problem.transcription, as_requested=True)
    return _with_starts(_solved(work, solution, [certificate], wire), found.runs)


def _known(work: Work, problem: Problem) -> Guess | None:
    """With the shared optimum, the joint program's own motion: from elsewhere the task may end in a worse optimum."""
    return None if work.point is None else point_guess(problem, program_of(problem), work.point)


def _accurate(work: Work, problem: Problem, options: SolverOptions, progress: Progress) -> Outcome:
    """Refined until the replay meets the accuracy that was asked for; a motion that does not is no result."""
    accuracy = work.application.accuracy
    assert accuracy is not None
    starts, known = work.application.starts, _known(work, problem)
    found = solve_accurately(problem, accuracy, options, progress, starts=starts, known=known)
    solution, certificate = found.solution, found.certificate
    if certificate is None:
        return _failed(solution)
    wire = certificate_wire(certificate, accuracy, solution.problem.transcription, as_requested=False)
    wire["refinements"] = [refinement_wire(step) for step in found.rounds]
    if not found.met:
        return Outcome(JobState.FAILED, missed(found, accuracy), summary=_how(solution) | {"certificate": wire})
    return _with_starts(_solved(work, solution, [step.certificate for step in found.rounds], wire), found.starts)


def _with_starts(outcome: Outcome, runs: Sequence[StartRun]) -> Outcome:
    """The same outcome with the spread of the optima that several starts found."""
    if not runs:
        return outcome
    starts = {
        "solved": sum(run.objective is not None for run in runs),
        "ends": [{"objective": end.objective, "starts": end.starts} for end in ends(runs)],
        "runs": [
            {
                "solver_status": run.status,
                "objective": run.objective,
                "iterations": run.iterations,
                "solve_time_s": run.seconds,
            }
            for run in runs
        ],
    }
    return replace(outcome, summary=dict(outcome.summary) | {"starts": starts})


def _failed(solution: Solution) -> Outcome:
    state = JobState.CANCELLED if solution.status == STOPPED else JobState.FAILED
    return Outcome(state, solution.reason, summary=_how(solution))


def _solved(work: Work, solution: Solution, certificates: Sequence[Certificate], wire: dict[str, Any]) -> Outcome:
    """The result of a motion with the certificates of all rounds, the last of them its own."""
    certificate = certificates[-1]
    assert solution.measures is not None
    assert solution.design is not None
    assert solution.objective is not None
    assert solution.lam_x is not None
    assert solution.lam_g is not None
    summary = _how(solution) | _measures(solution.measures)
    summary["certificate_time_s"] = sum(each.seconds for each in certificates)
    if certificate.energies is not None:
        summary |= energies_wire(certificate.energies)
    if certificate.load is not None:
        summary |= _load(certificate.load)
    inputs = input_hash(work.application, work.spec.task_index, work.design, work.gear_ratio)
    summary["certificate"] = wire | {"input_hash": inputs}
    objective = solution.problem.objective
    if objective.kind == "weighted":
        summary["references"] = {"time_s": objective.time_reference, "energy_V2s": objective.effort_reference}
    summary["objective"] = solution.objective
    slopes = limit_slopes(solution.problem, solution.lam_x, solution.lam_g)
    summary["limits"] = limits_wire(binding(slopes, solution.objective))
    summary["design_mm"] = design_mm(solution.design)
    if work.application.freedom.gears:
        summary |= gears_wire(solution.problem.robot.gear_ratio)
    return Outcome(JobState.SUCCEEDED, None, solution.objective, summary, pack(solution, certificate.law))


def _how(solution: Solution) -> dict[str, Any]:
    """How a solve went."""
    return {
        "solver_status": solution.status,
        "reason": solution.reason,
        "iterations": solution.iterations,
        "solve_time_s": solution.solve_time,
        "attempts": [
            {"name": a.name, "solver_status": a.status, "iterations": a.iterations, "solve_time_s": a.seconds}
            for a in solution.attempts
        ],
        "certificate": {
            "kkt_residual": finite(solution.kkt_residual),
            "constraint_violation": finite(solution.constraint_violation),
        },
    }


def _measures(measures: Measures) -> dict[str, Any]:
    return {
        "final_time_s": measures.final_time,
        "energy_V2s": measures.effort,
        "electrical_energy_J": measures.electrical_energy,
        "copper_loss_J": measures.copper_loss,
        "recovered_energy_J": measures.recovered_energy.tolist(),
        "peaks_at_points": _by_name(measures.load.peaks),
        **_load(measures.load),
    }


def _load(load: Load) -> dict[str, Any]:
    return {"peaks": _by_name(load.peaks), "rms": _by_name(load.rms)}


def _by_name(arrays: Mapping[str, np.ndarray]) -> dict[str, list[float]]:
    return {name: values.tolist() for name, values in arrays.items()}


def _reconcile(work: Work) -> Outcome:
    """Designs of all methods: Problem 2 for the mean, a task's own design for the others."""
    application, motor, designs = work.application, work.application.build_motor(), {}
    for method in application.base_methods:
        if method == "two_step":
            solved = sorted(work.own_designs)
            weights = [application.tasks[k].weight for k in solved]
            mean = mean_design([work.own_designs[k] for k in solved], weights)
            gears = mean_design([work.own_gears[k] for k in solved], weights) if work.own_gears else None
            projection = project_design(mean, motor)
            designs["mean"] = {"design_mm": design_mm(mean), "tasks": solved} | gears_wire(gears)
            if projection.feasible:
                distance = {"distance": projection.distance, "solver_status": projection.status}
                designs[method] = design_wire(projection.design, motor, gears) | distance
                if CATALOGUE in application.base_methods:
                    designs |= snapped_designs(application, method, projection.design, gears)
        elif (task := application.design_task(method)) in work.own_designs:
            designs[method] = design_wire(work.own_designs[task], motor, work.own_gears.get(task)) | {"task": task}
    missing = [method for method in application.base_methods if method not in designs]
    reason = f"no design for {', '.join(missing)}" if missing else None
    state = JobState.FAILED if application.method in missing or not designs else JobState.SUCCEEDED
    return Outcome(state, reason, summary={"methods": sorted(designs)}, designs=designs)
