"""The list of applications: each with how far it is and what it has reached, from few queries for a whole page."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Engine, Row, String, and_, cast, func, select
from sqlalchemy.orm import Session

from services.codesign.comparison import OWN
from services.jobs.owners import Owner, owned_by
from services.jobs.resolved import late_methods
from services.jobs.views import UNITS, iso_time
from shared.contracts.states import ApplicationItem, ApplicationList, TotalResult
from shared.db.engine import reading
from shared.db.tables import Application, Job, Result
from shared.domain import ApplicationState, JobState, Stage


@dataclass(frozen=True)
class Filters:
    """Which applications to list; None leaves a filter out."""

    state: str | None = None
    tag: str | None = None
    name: str | None = None
    """Part of the name, in any case."""
    owner: Owner = None


@dataclass
class _Figures:
    """Counts and sums of one application's jobs."""

    by_stage: Counter[str] = field(default_factory=Counter)
    done: int = 0
    totals: dict[str, tuple[int, float]] = field(default_factory=dict)
    """Tasks solved and the sum of their objectives, by method."""


def list_applications(engine: Engine, cursor: str | None, limit: int, filters: Filters) -> ApplicationList:
    """Newest first; `cursor` is the id after which to go on."""
    with reading(engine) as session:
        rows = _page(session, cursor, limit + 1, filters)
        figures = _figures(session, [row.id for row in rows[:limit]])
    items = [_item(row, figures[row.id]) for row in rows[:limit]]
    return ApplicationList(items=items, next_cursor=items[-1].id if len(rows) > limit else None)


def _page(session: Session, cursor: str | None, limit: int, filters: Filters) -> Sequence[Row[Any]]:
    """Without the resolved application, which may be large."""
    statement = (
        select(
            Application.id,
            Application.name,
            Application.state,
            Application.created_at,
            Application.finished_at,
            Application.tags,
            Application.resolved["objective"]["kind"].as_string().label("objective"),
            Application.resolved["methods"].label("methods"),
        )
        .order_by(Application.id.desc())
        .limit(limit)
    )
    statement = statement.where(owned_by(filters.owner, Application.owner))
    if cursor is not None:
        statement = statement.where(Application.id < cursor)
    if filters.state is not None:
        statement = statement.where(Application.state == filters.state)
    if filters.tag is not None:
        statement = statement.where(cast(Application.tags, String).contains(json.dumps(filters.tag), autoescape=True))
    if filters.name is not None:
        statement = statement.where(Application.name.icontains(filters.name, autoescape=True))
    return session.execute(statement).all()


def _figures(session: Session, ids: Sequence[str]) -> dict[str, _Figures]:
    figures: dict[str, _Figures] = defaultdict(_Figures)
    rows = session.execute(
        select(Job.application_id, Job.stage, Job.method, Job.state, func.count(), func.sum(Result.value))
        .join(Application, and_(Application.id == Job.application_id, Application.generation == Job.generation))
        .outerjoin(Result, Result.job_id == Job.id)
        .where(Job.application_id.in_(ids), Application.id.in_(ids))  # twice, so that both are found by index
        .group_by(Job.application_id, Job.stage, Job.method, Job.state)
    )
    for application, stage, method, state, count, total in rows:
        of = figures[application]
        of.by_stage[stage] += count
        of.done += count if JobState(state).final else 0
        if state == JobState.SUCCEEDED and total is not None:
            of.totals[method or OWN] = (count, total)
    return figures


def _item(row: Row[Any], figures: _Figures) -> ApplicationItem:
    tasks = figures.by_stage[Stage.CODESIGN]
    return ApplicationItem(
        id=row.id,
        name=row.name,
        state=row.state,
        created_at=iso_time(row.created_at) or "",
        finished_at=iso_time(row.finished_at),
        tags=row.tags,
        objective=row.objective,
        method=row.methods[0],
        tasks=tasks,
        done=figures.done,
        total=_total(row, figures, tasks),
        best=_best(row, figures),
    )


def _total(row: Row[Any], figures: _Figures, tasks: int) -> int:
    """Jobs that there are, or, while it goes on, that there will be when nothing fails."""
    counted = figures.by_stage
    if ApplicationState(row.state).final:
        return counted.total()
    late = late_methods(row.methods)
    motions = counted[Stage.MOTIONS] or tasks * (len(row.methods) - len(late))
    shared = (1 + (counted[Stage.SHARED_MOTIONS] or tasks * len(late))) * bool(late)
    return tasks + (counted[Stage.RECONCILE] or 1) + motions + shared


def _best(row: Row[Any], figures: _Figures) -> TotalResult | None:
    """The application's method, or until it has motions, the tasks' own designs."""
    for method in (row.methods[0], OWN):
        if method in figures.totals:
            tasks, value = figures.totals[method]
            return TotalResult(method=method, tasks=tasks, value=value, unit=UNITS[row.objective])
    return None
