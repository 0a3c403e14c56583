"""Do again what failed, and only that: a new generation from the earliest stage that has something to do again.

Rows of what stays valid move to the new generation; what failed stays behind as history. A co-design that is solved
now changes the mean, so everything after it is planned afresh.
"""

from __future__ import annotations

from sqlalchemy import Engine, delete, false, select, true, update
from sqlalchemy.orm import Session

from services.jobs.open_stage import open_stage
from services.jobs.plan import JobSpec, NextStage
from services.jobs.resolved import late_methods
from services.jobs.store import lock_application
from shared.db.engine import transaction
from shared.db.tables import Application, Design, Job, Result, Stage
from shared.domain import ApplicationState, JobState
from shared.domain import Stage as StageName

ORDER = list(StageName)


class NotRetryableError(Exception):
    """The application has nothing to do again; the message says why."""


def retry(engine: Engine, application_id: str) -> bool:
    """Queue what failed, died or was cancelled; False when there is no such application.

    Raises
    ------
    NotRetryableError
        It still runs, or everything succeeded.
    """
    with transaction(engine) as session:
        application = lock_application(session, application_id)
        if application is None:
            return False
        if not ApplicationState(application.state).final:
            raise NotRetryableError(f"the application is {application.state}; only what has ended can be retried")
        jobs = _jobs(session, application)
        open_jobs = [job for job in jobs if job.state != JobState.SUCCEEDED]
        if not open_jobs:
            raise NotRetryableError("every job of the application succeeded; there is nothing to do again")
        stage = min((StageName(job.stage) for job in open_jobs), key=ORDER.index)
        again = [_spec(job) for job in open_jobs if job.stage == stage]
        _new_generation(session, application, [job for job in jobs if _stays(job, stage)], stage)
        application.state, application.reason = ApplicationState.QUEUED, None
        application.cancel_requested, application.finished_at = False, None
        open_stage(session, application, NextStage(stage, tuple(again)))
        return True


def _jobs(session: Session, application: Application) -> list[Job]:
    return list(
        session.scalars(
            select(Job).where(Job.application_id == application.id, Job.generation == application.generation)
        )
    )


def _spec(job: Job) -> JobSpec:
    return JobSpec(StageName(job.stage), job.method, job.task_index)


def _stays(job: Job, retried: StageName) -> bool:
    """Earlier stages stay as they are, and so does what succeeded in the retried one."""
    return ORDER.index(StageName(job.stage)) <= ORDER.index(retried) and job.state == JobState.SUCCEEDED


def _new_generation(session: Session, application: Application, staying: list[Job], retried: StageName) -> None:
    old, new = application.generation, application.generation + 1
    ids = [job.id for job in staying]
    earlier = ORDER[: ORDER.index(retried)]
    of_application = {"application_id": application.id, "generation": old}
    early = Design.kind.not_in(late_methods(application.resolved["methods"]))
    for table, chosen in (
        (Job, Job.id.in_(ids)),
        (Result, Result.job_id.in_(ids)),
        (Stage, Stage.name.in_(earlier)),
    ):
        session.execute(
            update(table)
            .where(*(getattr(table, name) == value for name, value in of_application.items()), chosen)
            .values(generation=new)
            .execution_options(synchronize_session=False)
        )
    kept = {StageName.SHARED_MOTIONS: true(), StageName.MOTIONS: early, StageName.SHARED_OPTIMUM: early}
    session.execute(delete(Design).filter_by(**of_application).where(~kept.get(retried, false())))
    session.execute(update(Design).filter_by(**of_application).values(generation=new))
    application.generation = new
    session.flush()
