"""All tasks of an application at a glance, and what it means in full."""

from __future__ import annotations

from collections import defaultdict

from sqlalchemy import Engine, select
from sqlalchemy.orm import Session

from services.codesign.comparison import OWN
from services.jobs.views import load, objective_unit
from shared.contracts.overview import Overview, Resolved, RunningJob, SolveOutcome, TaskOverview
from shared.db.clock import now
from shared.db.engine import reading
from shared.db.tables import Application, Job, Result
from shared.domain import NO_TASK, JobState


def overview(engine: Engine, application_id: str) -> Overview:
    """Every task's state and objective, read from narrow columns: 2,000 tasks are a few hundred kilobytes.

    Raises
    ------
    NotFoundError
    """
    with reading(engine) as session:
        application, resolved = load(session, application_id)
        outcomes = _outcomes(session, application)
        return Overview(
            application_id=application.id,
            unit=objective_unit(resolved),
            last_event=application.last_event,
            grid=resolved.grid,
            methods=resolved.methods,
            tasks=[
                TaskOverview(index=k, name=task.name, payload_kg=task.payload_kg, outcomes=outcomes[k])
                for k, task in enumerate(resolved.tasks)
            ],
            running=_running(session, application),
        )


def _outcomes(session: Session, application: Application) -> dict[int, dict[str, SolveOutcome]]:
    rows = session.execute(
        select(Job.task_index, Job.method, Job.state, Job.reason, Result.value)
        .outerjoin(Result, Result.job_id == Job.id)
        .where(
            Job.application_id == application.id,
            Job.generation == application.generation,
            Job.task_index != NO_TASK,
        )
        .order_by(Job.round)
    )
    outcomes: dict[int, dict[str, SolveOutcome]] = defaultdict(dict)
    for task, method, state, reason, value in rows:
        outcomes[task][method or OWN] = SolveOutcome(state=state, value=value, reason=reason)
    return outcomes


def _running(session: Session, application: Application) -> list[RunningJob]:
    rows = session.execute(
        select(Job.stage, Job.method, Job.task_index, Job.worker, now() - Job.started_at)
        .where(
            Job.application_id == application.id,
            Job.generation == application.generation,
            Job.state == JobState.RUNNING,
        )
        .order_by(Job.started_at)
    )
    return [
        RunningJob(stage=stage, method=method or OWN, task_index=task, worker=worker, for_s=max(0.0, age or 0.0))
        for stage, method, task, worker, age in rows
    ]


def resolved(engine: Engine, application_id: str) -> Resolved:
    """What an application means: robot, motor constants and tasks explicit.

    Raises
    ------
    NotFoundError
    """
    with reading(engine) as session:
        application, meaning = load(session, application_id)
        request = application.request
    content = meaning.model_dump(mode="json")
    return Resolved(
        **{**content, "motor": meaning.build_motor().to_wire()}, application_id=application_id, request=request
    )
