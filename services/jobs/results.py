"""Designs, comparison and motions of an application, as people get them."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from sqlalchemy import Engine, select
from sqlalchemy.orm import Session

from services.codesign.comparison import OWN, compare
from services.codesign.motor_data import DIMENSIONS
from services.codesign.voltage_law import VoltageLaw
from services.jobs.arrays import POINT, unpack, unpack_law, unpack_motion
from services.jobs.design_wire import design_mm
from services.jobs.limit_costs import limit_costs
from services.jobs.resolved import ResolvedApplication
from services.jobs.store import MOTION_STAGES, results_of
from services.jobs.views import NotFoundError, load, objective_unit, require_task
from shared.contracts.comparisons import (
    ComparisonAnswer,
    DesignAnswer,
    DesignsAnswer,
    LimitCost,
    MethodTotals,
    OwnDesign,
    Regret,
    ScatteredTask,
    SharedDesign,
    Spread,
)
from shared.contracts.motions import SolverIteration, SolverLog, SolverPoint, Trajectory, VoltageControl
from shared.db.engine import reading
from shared.db.tables import Application, Design, Result
from shared.domain import Stage

CONTROL = {
    "piecewise_constant": "constant on each interval: the value at a point holds on the interval that it ends",
    "piecewise_polynomial": "currents are linear in time on each interval; voltages follow from the motor's equations",
}


def design(engine: Engine, application_id: str, method: str | None = None) -> DesignAnswer:
    """The application's design, or that of one of its other methods."""
    with reading(engine) as session:
        application, resolved = load(session, application_id)
        name = method or resolved.method
        stored = session.get(Design, (application.id, application.generation, name))
        if stored is None or name not in resolved.methods:
            raise NotFoundError(_no_design(application, resolved, name))
    return DesignAnswer(
        application_id=application_id,
        method=name,
        motors=stored.content["motors"],
        design_mm=stored.content["design_mm"],
        gear_ratio=stored.content.get("gear_ratio"),
    )


def _no_design(application: Application, resolved: ResolvedApplication, name: str) -> str:
    if name not in resolved.methods:
        return f"the application has methods {', '.join(resolved.methods)}, not {name}"
    return f"there is no design of method {name}; the application is {application.state}"


def designs(engine: Engine, application_id: str) -> DesignsAnswer:
    """Every task's own design, the mean, and each method's."""
    with reading(engine) as session:
        application, resolved = load(session, application_id)
        own = results_of(session, application, Stage.CODESIGN)
        shared = _shared_designs(session, application)
    return DesignsAnswer(
        dimensions=list(DIMENSIONS),
        tasks=[
            OwnDesign(
                index=r.task_index,
                name=resolved.tasks[r.task_index].name,
                design_mm=r.summary["design_mm"],
                gear_ratio=r.summary.get("gear_ratio"),
            )
            for r in own
            if "design_mm" in r.summary
        ],
        mean=_shared_design(shared.pop("mean", None)),
        methods={name: answer for name, content in shared.items() if (answer := _shared_design(content)) is not None},
    )


def _shared_designs(session: Session, application: Application) -> dict[str, dict[str, Any]]:
    rows = session.scalars(
        select(Design).where(Design.application_id == application.id, Design.generation == application.generation)
    )
    return {row.kind: row.content for row in rows}


def _shared_design(content: dict[str, Any] | None) -> SharedDesign | None:
    return None if content is None else SharedDesign.model_validate(content)


def comparison(engine: Engine, application_id: str) -> ComparisonAnswer:
    """Methods side by side over the tasks that all of them solved, and their regret."""
    with reading(engine) as session:
        application, resolved = load(session, application_id)
        found = {OWN: _solved(results_of(session, application, Stage.CODESIGN))}
        motions = results_of(session, application, *MOTION_STAGES)
        shared = _shared_designs(session, application)
    found |= {method: _solved([r for r in motions if r.method == method]) for method in resolved.methods}
    present = {name: results for name, results in found.items() if results}
    values = {
        name: [results[k]["objective"] if k in results else None for k in range(len(resolved.tasks))]
        for name, results in present.items()
    }
    sums = compare(values.pop(OWN, []), values)
    return ComparisonAnswer(
        objective=resolved.objective.kind,
        unit=objective_unit(resolved),
        tasks_compared=list(sums.counted),
        task_names=[resolved.tasks[k].name for k in sums.counted],
        task_weights=[resolved.tasks[k].weight for k in sums.counted],
        grid=resolved.grid,
        methods={
            name: _totals(resolved, {k: results[k] for k in sums.counted}, shared.get(name, {}).get("design_mm"))
            for name, results in present.items()
        },
        regret={
            name: Regret(total=sums.total_regret[name], per_task=[sums.regret[name][k] for k in sums.counted])
            for name in values
        },
        judged={
            name: resolved.over_tasks({k: results[k]["objective"] for k in sums.counted})
            for name, results in present.items()
            if sums.counted
        },
        unsolved={name: list(tasks) for name, tasks in sums.failed.items()},
        scattered=list(_scattered(resolved, sums.counted, present)),
        limits={
            name: _limits(resolved, {k: results[k] for k in sums.counted}, shared.get(name, {}))
            for name, results in present.items()
            if sums.counted
        },
        missing={
            method: "has a design, but no motion yet" if method in shared else "has no design"
            for method in resolved.methods
            if method not in present
        },
    )


def _solved(results: list[Result]) -> dict[int, dict[str, Any]]:
    return {r.task_index: r.summary for r in results if "final_time_s" in r.summary}


MEASURES = ("objective", "final_time_s", "energy_V2s", "electrical_energy_J", "copper_loss_J")


def _totals(
    resolved: ResolvedApplication, results: dict[int, dict[str, Any]], design_mm: list[list[float]] | None
) -> MethodTotals:
    summaries = list(results.values())
    totals = {name: sum(summary[name] for summary in summaries) for name in MEASURES}
    worst = max(results, key=lambda k: float(results[k]["objective"]), default=None)
    return MethodTotals(
        weighted_objective=sum(resolved.tasks[k].weight * summary["objective"] for k, summary in results.items()),
        worst_objective=0.0 if worst is None else results[worst]["objective"],
        worst_task=worst,
        total_objective=totals["objective"],
        total_time_s=totals["final_time_s"],
        total_energy_V2s=totals["energy_V2s"],
        total_electrical_energy_J=totals["electrical_energy_J"],
        total_copper_loss_J=totals["copper_loss_J"],
        per_task=[{name: summary[name] for name in MEASURES} for summary in summaries],
        design_mm=design_mm,
    )


def _scattered(
    resolved: ResolvedApplication, counted: Sequence[int], present: Mapping[str, dict[int, dict[str, Any]]]
) -> Iterator[ScatteredTask]:
    """The tasks as given, each over its samples that every method solved."""
    for place, name in enumerate(resolved.given_tasks):
        samples = [k for k in counted if resolved.given_task_of(k) == place]
        if samples:
            methods = {m: _spread([float(results[k]["objective"]) for k in samples]) for m, results in present.items()}
            yield ScatteredTask(name=name, samples=len(samples), methods=methods)


def _spread(values: list[float]) -> Spread:
    deviation = statistics.stdev(values) if len(values) > 1 else 0.0
    return Spread(mean=statistics.fmean(values), standard_deviation=deviation, largest=max(values))


def _limits(
    resolved: ResolvedApplication, results: dict[int, dict[str, Any]], stored: dict[str, Any]
) -> list[LimitCost]:
    deciding = {task["index"]: task["share"] for task in stored.get("deciding_tasks") or []}
    shares = resolved.shares_of_tasks({k: summary["objective"] for k, summary in results.items()}, deciding)
    motions = {k: summary.get("limits", []) for k, summary in results.items()}
    return limit_costs(motions, shares, stored.get("limits") or [])


def log(engine: Engine, application_id: str, task: int, method: str | None) -> SolverLog:
    """How the solver came to a motion, or failed to."""
    with reading(engine) as session:
        application, resolved = load(session, application_id)
        name = method or resolved.method
        found = _result(session, application, resolved, task, name)
    if found is None:
        raise NotFoundError(f"task {task} has not been solved with method {name}")
    iterations = [
        SolverIteration(attempt=attempt, iteration=iteration, objective=objective)
        for attempt, iteration, objective in found.log
    ]
    how = found.summary
    return SolverLog(
        application_id=application_id,
        task=task,
        method=name,
        solver_status=how.get("solver_status"),
        reason=how.get("reason"),
        attempts=how.get("attempts", []),
        iterations=iterations,
    )


def _result(
    session: Session, application: Application, resolved: ResolvedApplication, task: int, method: str
) -> Result | None:
    require_task(resolved, task)
    return session.scalars(
        select(Result).where(
            Result.application_id == application.id,
            Result.generation == application.generation,
            Result.stage.in_([Stage.CODESIGN] if method == OWN else MOTION_STAGES),
            Result.method == ("" if method == OWN else method),
            Result.task_index == task,
        )
    ).one_or_none()


def trajectory(engine: Engine, application_id: str, task: int, method: str | None) -> Trajectory:
    """A motion on its grid: the task's own (method `own`), or with a method's design (default: the application's)."""
    with reading(engine) as session:
        application, resolved = load(session, application_id)
        name = method or resolved.method
        found = _result(session, application, resolved, task, name)
    if found is None or found.arrays is None:
        why = "" if found is None or found.summary.get("reason") is None else f": {found.summary['reason']}"
        raise NotFoundError(f"there is no motion of task {task} with method {name}{why}")
    motion, design = unpack_motion(found.arrays)
    return Trajectory(
        application_id=application_id,
        task=task,
        method=name,
        time_s=motion.time.tolist(),
        joint_position_rad=motion.position.tolist(),
        joint_speed_rad_s=motion.speed.tolist(),
        joint_torque_Nm=motion.torque.tolist(),
        current_d_A=motion.current_d.tolist(),
        current_q_A=motion.current_q.tolist(),
        voltage_d_V=motion.voltage_d.tolist(),
        voltage_q_V=motion.voltage_q.tolist(),
        control=_control(unpack_law(found.arrays)),
        design_mm=design_mm(design),
        gear_ratio=found.summary.get("gear_ratio"),
        scheme=found.summary["certificate"]["scheme"],
        degree=found.summary["certificate"]["degree"],
    )


def solver_point(engine: Engine, application_id: str, task: int, method: str | None) -> SolverPoint:
    """The point and multipliers of a motion, for whoever checks that it is optimal."""
    with reading(engine) as session:
        application, resolved = load(session, application_id)
        name = method or resolved.method
        found = _result(session, application, resolved, task, name)
    if found is None or found.arrays is None:
        raise NotFoundError(f"there is no motion of task {task} with method {name}")
    arrays, certificate = unpack(found.arrays), found.summary["certificate"]
    breaks = unpack_law(found.arrays).breaks
    return SolverPoint(
        application_id=application_id,
        task=task,
        method=name,
        **{key: certificate[key] for key in ("scheme", "degree", "intervals", "control")},
        widths=(np.diff(breaks) / breaks[-1]).tolist(),
        **{key: arrays[key].tolist() for key in POINT},
    )


def inputs(engine: Engine, application_id: str) -> ResolvedApplication:
    """What an application was understood to ask, with every default: what its motions are computed from."""
    with reading(engine) as session:
        _, resolved = load(session, application_id)
    return resolved


def _control(law: VoltageLaw) -> VoltageControl:
    constant = law.voltage_d.shape[1] == 1
    kind: Literal["piecewise_constant", "piecewise_polynomial"] = (
        "piecewise_constant" if constant else "piecewise_polynomial"
    )
    return VoltageControl(
        kind=kind,
        description=CONTROL[kind],
        breaks_s=law.breaks.tolist(),
        voltage_d_V=law.voltage_d.tolist(),
        voltage_q_V=law.voltage_q.tolist(),
    )
