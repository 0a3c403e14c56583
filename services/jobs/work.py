"""Everything a claimed job needs, read from the database once, so that no transaction spans a solve."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from sqlalchemy import ColumnElement, Engine, select
from sqlalchemy.orm import Session, load_only

from services.codesign.guess import MotionPoint
from services.codesign.kept import Kept
from services.codesign.motion import Motion
from services.codesign.shared_optimum import SharedStart
from services.codesign.solve import References
from services.jobs.arrays import unpack_motion, unpack_point
from services.jobs.claim import Claim
from services.jobs.design_wire import design_array
from services.jobs.plan import JobSpec
from services.jobs.resolved import SHARED, ResolvedApplication
from services.jobs.spec import spec_of
from services.jobs.store import MOTION_STAGES, results_of
from shared.contracts.application import MethodName
from shared.db.engine import reading
from shared.db.tables import Application, Design, Result
from shared.domain import Stage


@dataclass(frozen=True)
class SharedInputs:
    """The tasks whose own co-design succeeded, and the best design known for them."""

    tasks: list[int]
    references: dict[int, References]  # of a weighted objective
    method: str  # whose design is the best
    total: float  # what it is judged by (`comparison.over_tasks`), infinite unless it can do every task
    start: SharedStart
    gear_ratio: np.ndarray | None = None  # (n,), of the best design known, where gear ratios are free


@dataclass(frozen=True)
class Work:
    """One job, ready to be executed."""

    spec: JobSpec
    application: ResolvedApplication
    own_designs: dict[int, np.ndarray]  # reconcile: each solved task's design, (n, 7) m
    own_gears: dict[int, np.ndarray] = field(default_factory=dict)  # reconcile, where gear ratios are free: each (n,)
    design: np.ndarray | None = None  # motions: the design given, (n, 7) m
    gear_ratio: np.ndarray | None = None  # motions: the design's, (n,), where gear ratios are free
    references: References | None = None  # motions of a weighted objective: those of the task's own solve
    point: MotionPoint | None = None  # motions with the shared optimum: where the joint program has this one
    shared: SharedInputs | None = None  # shared optimum: the tasks in it, and where it starts


def load_work(engine: Engine, held: Claim) -> Work | None:
    """Read a job's inputs; None when its application was deleted."""
    with reading(engine) as session:  # which asks nothing of the database before there is something to ask
        resolved = spec_of(session, held.application_id)
        if resolved is None:
            return None
        if held.spec.stage == Stage.CODESIGN:
            return Work(held.spec, resolved, {})
        return _with_inputs(session, held, resolved)


def _with_inputs(session: Session, held: Claim, resolved: ResolvedApplication) -> Work | None:
    """Inputs that earlier stages made; None when the application was deleted."""
    if held.spec.stage in MOTION_STAGES:
        return _motion_work(session, held, resolved)
    application = session.get(Application, held.application_id, options=[load_only(Application.generation)])
    if application is None:
        return None
    if held.spec.stage == Stage.SHARED_OPTIMUM:
        return Work(held.spec, resolved, {}, shared=_shared_inputs(session, application, resolved))
    results = results_of(session, application, Stage.CODESIGN)
    own = {r.task_index: design_array(r.summary["design_mm"]) for r in results if r.summary.get("design_mm")}
    gears = {r.task_index: found for r in results if (found := _gears(r.summary)) is not None}
    return Work(held.spec, resolved, own, gears)


def _motion_work(session: Session, held: Claim, resolved: ResolvedApplication) -> Work | None:
    """A motion with a design that is given."""
    task, of_generation = held.spec.task_index, (held.application_id, held.generation)
    design = _design(session, (*of_generation, held.spec.method))
    if design is None:
        return None
    joint = _joint_motions(session, of_generation) if held.spec.method == SHARED else None
    return Work(
        held.spec,
        resolved,
        {},
        design=design_array(design["design_mm"]),
        gear_ratio=_gears(design),
        references=_references_of(session, of_generation, task) if resolved.objective.kind == "weighted" else None,
        point=None if joint is None else unpack_point(joint, task),
    )


Generation = tuple[str, int]
"""An application's id and which of its generations: what earlier stages made in it changes no more."""

_DESIGNS: Kept[dict[str, Any] | None] = Kept(16)
"""Those that were asked for last: each of a hundred jobs needs the same."""

_JOINT_MOTIONS: Kept[bytes | None] = Kept(2)
"""Packed motions of the joint programs that were asked for last: some forty kilobytes a task, and each of a hundred
jobs needs one task's."""


def _design(session: Session, key: tuple[str, int, str]) -> dict[str, Any] | None:
    """The design of a generation's method; None when the application was deleted."""
    application_id, generation, method = key
    stored = select(Design.content).filter_by(application_id=application_id, generation=generation, kind=method)
    return _DESIGNS.get(key, lambda: session.scalar(stored))


def _joint_motions(session: Session, of_generation: Generation) -> bytes | None:
    """Where the joint program has the motions; None where its design was no better and another's stays."""
    statement = select(Result.arrays).where(*_results(of_generation), Result.stage == Stage.SHARED_OPTIMUM)
    return _JOINT_MOTIONS.get(of_generation, lambda: session.scalar(statement))


def _references_of(session: Session, of_generation: Generation, task: int) -> References | None:
    """Those of a weighted objective, from the task's own solve."""
    of_task = (*_results(of_generation), Result.stage == Stage.CODESIGN, Result.task_index == task)
    return _references(session.scalar(select(Result.summary).where(*of_task)))


def _results(of_generation: Generation) -> tuple[ColumnElement[bool], ColumnElement[bool]]:
    application_id, generation = of_generation
    return Result.application_id == application_id, Result.generation == generation


def _gears(stored: dict[str, Any]) -> np.ndarray | None:
    """Gear ratios of a design, shape (n,), where they were free."""
    return np.array(stored["gear_ratio"]) if stored.get("gear_ratio") else None


def _references(own: dict[str, Any] | None) -> References | None:
    found = None if own is None else own.get("references")
    return None if found is None else References(found["time_s"], found["energy_V2s"])


def _shared_inputs(session: Session, application: Application, resolved: ResolvedApplication) -> SharedInputs | None:
    """Start from the method that solved most tasks, and among those from the one that is best over them."""
    own = {r.task_index: r for r in results_of(session, application, Stage.CODESIGN) if "objective" in r.summary}
    motions = results_of(session, application, Stage.MOTIONS)
    found: list[tuple[int, float, MethodName, dict[int, Result]]] = []
    for method in resolved.base_methods:
        solved = {r.task_index: r for r in motions if r.method == method and "objective" in r.summary}
        total = resolved.over_tasks({k: r.summary["objective"] for k, r in solved.items()})
        found.append((-len(solved), total, method, solved))
    _, total, method, solved = min(found, key=lambda entry: entry[:2])
    stored = session.get(Design, (application.id, application.generation, method))
    if stored is None:
        return None
    tasks = sorted(own)
    return SharedInputs(
        tasks=tasks,
        references={k: known for k in tasks if (known := _references(own[k].summary)) is not None},
        method=method,
        total=total if len(solved) == len(tasks) else float("inf"),
        start=SharedStart(design_array(stored.content["design_mm"]), [_motion(solved.get(k, own[k])) for k in tasks]),
        gear_ratio=_gears(stored.content),
    )


def _motion(result: Result) -> Motion:
    assert result.arrays is not None, "a solved task has its motion"
    return unpack_motion(result.arrays)[0]
