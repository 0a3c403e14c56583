"""What one application, and one owner, may ask for."""

from __future__ import annotations

from sqlalchemy import Connection, func, select

from services.jobs.owners import Owner, owned_by
from services.jobs.resolved import ResolvedApplication
from shared.contracts.errors import FieldError, InvalidInputError
from shared.db.tables import Application, Stage
from shared.domain import ApplicationState
from shared.settings import Settings


class QueueFullError(Exception):
    """An owner has as many jobs in the queue as may be; `error` says how many."""

    def __init__(self, error: FieldError) -> None:
        super().__init__(error.message)
        self.error = error


def refuse_long_trajectories(settings: Settings, application: ResolvedApplication) -> None:
    """Check the points of a transcription that was asked for; a refinement has its own bounds.

    Raises
    ------
    InvalidInputError
    """
    asked = application.transcription
    points = (asked.degree or 1) * (asked.intervals or 0)
    if points > settings.max_points:
        limit = f"degree times intervals, the points of a trajectory, must be at most {settings.max_points}"
        raise InvalidInputError([FieldError("transcription.intervals", asked.intervals, limit)])


_OUT = (
    select(func.sum(Stage.remaining))
    .join(Application, Application.id == Stage.application_id)
    .where(Application.state.in_([state for state in ApplicationState if not state.final]))
)
"""Jobs of all open stages."""


def refuse_when_full(connection: Connection, settings: Settings, owner: Owner, adding: int) -> None:
    """Check how many jobs an owner (or everybody, where there are no keys) would have waiting and running.

    Read from the counters of the stages that are open: a row a stage, not one a job. Submissions at the same moment do
    not see each other on Postgres, so the limit can be overrun by as many as come at once.

    Raises
    ------
    QueueFullError
    """
    waiting = connection.scalar(_OUT.where(owned_by(owner, Application.owner)))
    if (waiting or 0) + adding > settings.max_queued_jobs:
        limit = f"{waiting or 0} jobs wait or run already, and at most {settings.max_queued_jobs} may for one key"
        raise QueueFullError(FieldError("tasks", adding, limit))
