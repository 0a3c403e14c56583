"""Sweeps: one application for every combination of values, and one table of what they gave."""

from __future__ import annotations

import copy
import itertools
import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import ValidationError
from sqlalchemy import Engine, and_, delete, func, select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from services.codesign.comparison import OWN
from services.codesign.motor_data import DIMENSIONS
from services.jobs.cancel import cancel
from services.jobs.limits import refuse_when_full
from services.jobs.open_stage import NewApplication, open_first
from services.jobs.owners import Owner, owned_by
from services.jobs.plan import NextStage
from services.jobs.submit import earlier_with, hash_of, key_of_owner, prepare
from services.jobs.views import UNITS, NotFoundError, iso_time
from shared.contracts import sweeps as wire
from shared.contracts.application import LONGEST_NAME, ApplicationRequest
from shared.contracts.errors import FieldError, InvalidInputError, field_errors
from shared.db.engine import reading, transaction
from shared.db.tables import Application, Design, Job, Result, Sweep, SweepPoint
from shared.domain import ApplicationState, JobState, new_id
from shared.settings import Settings

TOTALS = {"time_s": "final_time_s", "energy_V2s": "energy_V2s", "electrical_energy_J": "electrical_energy_J"}
"""Columns of the table, and where a result's summary has them."""


def submit_sweep(
    engine: Engine,
    settings: Settings,
    request: wire.SweepRequest,
    idempotency_key: str | None = None,
    owner: Owner = None,
) -> tuple[str, bool]:
    """Store a sweep with all its applications in one transaction: all of it is accepted, or none.

    Returns
    -------
    tuple
        Its id, and whether it is new (False: the key and the same request were seen before).

    Raises
    ------
    InvalidInputError
        A combination is no valid application (its errors say which), or there are too many.
    IdempotencyConflictError
        The key belongs to another request.
    QueueFullError
        The owner has too many jobs in the queue already.
    """
    key = None if idempotency_key is None else key_of_owner(idempotency_key, owner)
    if key is not None and (earlier := earlier_with(engine, Sweep, key, hash_of(request))):
        return earlier, False
    points = [
        (values, *_prepared(engine, settings, request, values, owner))
        for values in combinations(request.axes, settings.max_sweep_points)
    ]
    sweep = Sweep(
        id=new_id(),
        name=request.name,
        request=request.model_dump(mode="json"),
        tags=list(request.tags),
        idempotency_key=key,
        request_hash=hash_of(request),
        owner=owner,
    )
    try:
        with transaction(engine) as session:
            connection = session.connection()
            refuse_when_full(connection, settings, owner, sum(len(first.jobs) for _, _, first in points))
            session.add(sweep)
            session.flush()
            for position, (values, application, first) in enumerate(points):
                open_first(connection, application, first)
                of_sweep = {"sweep_id": sweep.id, "position": position, "application_id": application.id}
                session.add(SweepPoint(**of_sweep, axis_values=values))
    except IntegrityError:
        if key is None or (earlier := earlier_with(engine, Sweep, key, hash_of(request))) is None:
            raise
        return earlier, False
    return sweep.id, True


def combinations(axes: Mapping[str, Sequence[Any]], most: int) -> Iterator[dict[str, Any]]:
    """Every choice of one value from each axis; the last axis varies fastest.

    Raises
    ------
    InvalidInputError
        There are more than `most`.
    """
    count = math.prod(len(values) for values in axes.values())
    if count > most:
        raise InvalidInputError([FieldError("axes", count, f"at most {most} combinations in one sweep")])
    return (dict(zip(axes, chosen, strict=True)) for chosen in itertools.product(*axes.values()))


def with_value(application: Mapping[str, Any], path: str, value: Any) -> dict[str, Any]:
    """A copy of an application with one field replaced; mappings on the way are made where they are missing.

    Raises
    ------
    InvalidInputError
        The path leads through something that has no such part.
    """
    changed: dict[str, Any] = copy.deepcopy(dict(application))
    *way, last = [int(part) if part.isdigit() else part for part in re.findall(r"\w+", path)]
    place: Any = changed
    for part in way:
        place = _below(place, part, path)
    if not _has_room(place, last):
        raise InvalidInputError([FieldError(f"axes.{path}", value, "the base application has no such field")])
    place[last] = value
    return changed


def _below(place: Any, part: str | int, path: str) -> Any:
    if isinstance(place, dict) and isinstance(part, str):
        return place.setdefault(part, {})
    if not _has_room(place, part):
        raise InvalidInputError([FieldError(f"axes.{path}", None, "the base application has no such field")])
    return place[part]


def _has_room(place: Any, part: str | int) -> bool:
    if isinstance(place, dict):
        return isinstance(part, str)
    return isinstance(place, list) and isinstance(part, int) and part < len(place)


def _prepared(
    engine: Engine, settings: Settings, request: wire.SweepRequest, values: Mapping[str, Any], owner: Owner
) -> tuple[NewApplication, NextStage]:
    content: dict[str, Any] = dict(request.application)
    for path, value in values.items():
        content = with_value(content, path, value)
    label = ", ".join(f"{path}={value}" for path, value in values.items())
    if "name" not in values:
        content["name"] = f"{request.name}: {label}"[:LONGEST_NAME]
    if request.tags and "tags" not in content:
        content["tags"] = list(request.tags)
    try:
        return prepare(engine, settings, ApplicationRequest.model_validate(content), owner)
    except ValidationError as error:
        errors = field_errors(error)
    except InvalidInputError as error:
        errors = list(error.errors)
    raise InvalidInputError(
        FieldError(f"application.{error.field}", error.value, f"{error.limit} (with {label})") for error in errors
    )


def sweep_status(engine: Engine, sweep_id: str) -> wire.SweepStatus:
    """A sweep as it stands, with its table; read in four queries, whatever its size.

    Raises
    ------
    NotFoundError
    """
    with reading(engine) as session:
        sweep = _load(session, sweep_id)
        rows = session.execute(
            select(
                SweepPoint.position,
                SweepPoint.axis_values,
                Application.id,
                Application.state,
                Application.reason,
                Application.resolved["objective"]["kind"].as_string().label("objective"),
                Application.resolved["methods"].label("methods"),
                Application.resolved["tasks"].label("tasks"),
            )
            .join(Application, Application.id == SweepPoint.application_id)
            .where(SweepPoint.sweep_id == sweep_id)
            .order_by(SweepPoint.position)
        ).all()
        weights = {row.id: [task["weight"] for task in row.tasks] for row in rows}
        totals, designs = _totals(session, sweep_id, weights), _designs(session, sweep_id)
    counts = Counter(row.state for row in rows)
    return wire.SweepStatus(
        id=sweep.id,
        name=sweep.name,
        state=state_of(counts),
        created_at=iso_time(sweep.created_at) or "",
        tags=sweep.tags,
        axes=sweep.request["axes"],
        counts=dict(counts),
        dimensions=list(DIMENSIONS),
        points=[
            wire.SweepPointResult(
                position=row.position,
                values=row.axis_values,
                application_id=row.id,
                state=row.state,
                reason=row.reason,
                objective=row.objective,
                unit=UNITS[row.objective],
                method=row.methods[0],
                tasks=len(row.tasks),
                totals=totals[row.id],
                designs_mm={method: designs[row.id][method] for method in row.methods if method in designs[row.id]},
            )
            for row in rows
        ],
    )


def list_sweeps(engine: Engine, cursor: str | None, limit: int, owner: Owner = None) -> wire.SweepList:
    """Newest first; `cursor` is the id after which to go on."""
    statement = select(Sweep).where(owned_by(owner, Sweep.owner)).order_by(Sweep.id.desc()).limit(limit + 1)
    if cursor is not None:
        statement = statement.where(Sweep.id < cursor)
    with reading(engine) as session:
        rows = session.scalars(statement).all()
        counts: dict[str, Counter[str]] = defaultdict(Counter)
        states = (
            select(SweepPoint.sweep_id, Application.state, func.count())
            .join(Application, Application.id == SweepPoint.application_id)
            .where(SweepPoint.sweep_id.in_([row.id for row in rows]))
            .group_by(SweepPoint.sweep_id, Application.state)
        )
        for sweep_id, state, count in session.execute(states):
            counts[sweep_id][state] = count
        items = [
            wire.SweepItem(
                id=row.id,
                name=row.name,
                state=state_of(counts[row.id]),
                created_at=iso_time(row.created_at) or "",
                tags=row.tags,
                axes=list(row.request["axes"]),
                counts=dict(counts[row.id]),
            )
            for row in rows[:limit]
        ]
    return wire.SweepList(items=items, next_cursor=items[-1].id if len(rows) > limit else None)


def state_of(counts: Mapping[str, int]) -> ApplicationState:
    """One state for many applications: it ends when the last one does."""
    states = {ApplicationState(state) for state, count in counts.items() if count}
    if len(states) == 1:
        return states.pop()
    if any(not state.final for state in states):
        return ApplicationState.RUNNING
    if ApplicationState.CANCELLED in states:
        return ApplicationState.CANCELLED
    return ApplicationState.COMPLETED_WITH_FAILURES


def cancel_sweep(engine: Engine, sweep_id: str) -> None:
    """Cancel every application of a sweep that is not at its end.

    Raises
    ------
    NotFoundError
    """
    for application_id in _members(engine, sweep_id):
        cancel(engine, application_id)


def delete_sweep(engine: Engine, sweep_id: str) -> None:
    """Remove a sweep with its applications and all that they own.

    Raises
    ------
    NotFoundError
    """
    with transaction(engine) as session:
        _load(session, sweep_id)
        members = select(SweepPoint.application_id).where(SweepPoint.sweep_id == sweep_id)
        session.execute(delete(Application).where(Application.id.in_(members)))
        session.execute(delete(Sweep).where(Sweep.id == sweep_id))


def _load(session: Session, sweep_id: str) -> Sweep:
    sweep = session.get(Sweep, sweep_id)
    if sweep is None:
        raise NotFoundError(f"there is no sweep {sweep_id}")
    return sweep


def _members(engine: Engine, sweep_id: str) -> Sequence[str]:
    with reading(engine) as session:
        _load(session, sweep_id)
        return session.scalars(
            select(SweepPoint.application_id).where(SweepPoint.sweep_id == sweep_id).order_by(SweepPoint.position)
        ).all()


def _totals(
    session: Session, sweep_id: str, weights: Mapping[str, Sequence[float]]
) -> dict[str, dict[str, wire.SweepTotals]]:
    quantities = [Result.summary[field].as_float().label(name) for name, field in TOTALS.items()]
    rows = session.execute(
        select(Job.application_id, Job.method, Job.task_index, Result.value.label("objective"), *quantities)
        .join(SweepPoint, SweepPoint.application_id == Job.application_id)
        .join(Application, and_(Application.id == Job.application_id, Application.generation == Job.generation))
        .join(Result, Result.job_id == Job.id)
        .where(
            SweepPoint.sweep_id == sweep_id,
            Job.state == JobState.SUCCEEDED,
            Result.summary["final_time_s"].as_float().is_not(None),
        )
    )
    solved: dict[tuple[str, str], list[Any]] = defaultdict(list)
    for row in rows:
        solved[row.application_id, row.method or OWN].append(row)
    totals: dict[str, dict[str, wire.SweepTotals]] = defaultdict(dict)
    for (application, method), motions in solved.items():
        totals[application][method] = _sums(motions, weights[application])
    return totals


def _sums(motions: Sequence[Any], weights: Sequence[float]) -> wire.SweepTotals:
    """Over the tasks that one method solved."""
    return wire.SweepTotals(
        tasks=len(motions),
        objective=sum(motion.objective for motion in motions),
        weighted_objective=sum(weights[motion.task_index] * motion.objective for motion in motions),
        worst_objective=max(motion.objective for motion in motions),
        **{name: sum(getattr(motion, name) for motion in motions) for name in TOTALS},
    )


def _designs(session: Session, sweep_id: str) -> dict[str, dict[str, list[list[float]]]]:
    rows = session.execute(
        select(Design.application_id, Design.kind, Design.content["design_mm"])
        .join(SweepPoint, SweepPoint.application_id == Design.application_id)
        .join(Application, and_(Application.id == Design.application_id, Application.generation == Design.generation))
        .where(SweepPoint.sweep_id == sweep_id)
    )
    designs: dict[str, dict[str, list[list[float]]]] = defaultdict(dict)
    for application, kind, lengths in rows:
        designs[application][kind] = lengths
    return designs
