"""End a search for a shared design early: the best design found so far is used, and the application goes on."""

from __future__ import annotations

from sqlalchemy import Engine, Select, select

from services.jobs.store import emit, lock_application
from shared.db.engine import transaction
from shared.db.tables import Application, Job
from shared.domain import JobState, Stage


class NoSearchError(Exception):
    """The application searches for no shared design now; the message says in which state it is."""


def stop_search(engine: Engine, application_id: str) -> bool:
    """Ask the search to end; False when there is no such application. Asking twice changes nothing.

    One that still waits for a worker ends as soon as it begins, with the best design of the other methods.

    Raises
    ------
    NoSearchError
        No search runs or waits.
    """
    with transaction(engine) as session:
        application = lock_application(session, application_id)
        if application is None:
            return False
        job = session.scalars(searches(application)).one_or_none()
        if job is None:
            raise NoSearchError(
                f"no search for a shared design is running; the application is {application.state}, and a search "
                f"begins after the motions of the other methods, when method is shared_optimum"
            )
        if not job.stop_requested:
            job.stop_requested = True
            emit(session, application, "stop_search", {})
        return True


def searches(application: Application) -> Select[Job]:
    """The application's open search, if there is one."""
    return select(Job).where(
        Job.application_id == application.id,
        Job.generation == application.generation,
        Job.stage == Stage.SHARED_OPTIMUM,
        Job.state.in_([JobState.QUEUED, JobState.RUNNING]),
    )
