"""Accept an application: resolve it, then store it with its first jobs and their messages in one transaction."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import structlog
from pydantic import BaseModel
from sqlalchemy import Engine, select
from sqlalchemy.exc import IntegrityError

from services.jobs.limits import refuse_long_trajectories, refuse_when_full
from services.jobs.open_stage import NewApplication, open_first
from services.jobs.owners import Owner, owned_by
from services.jobs.plan import NextStage, plan_first
from services.jobs.resolve import resolve
from services.jobs.versions import versions
from shared.contracts.application import ApplicationRequest
from shared.db.engine import reading
from shared.db.tables import Application, Sweep, UploadedRobot
from shared.domain import new_id
from shared.settings import Settings

log = structlog.get_logger()


class IdempotencyConflictError(Exception):
    """An idempotency key was used before with another body."""


def submit(
    engine: Engine,
    settings: Settings,
    request: ApplicationRequest,
    idempotency_key: str | None = None,
    owner: Owner = None,
) -> tuple[str, bool]:
    """Store an application; from then on it ends in a final state whatever is killed.

    Returns
    -------
    tuple
        Its id, and whether it is new (False: the key and the same request were seen before).

    Raises
    ------
    InvalidInputError
        Nothing was stored.
    IdempotencyConflictError
        The key belongs to another request.
    QueueFullError
        The owner has too many jobs in the queue already.
    """
    key = None if idempotency_key is None else key_of_owner(idempotency_key, owner)
    if key is not None and (earlier := earlier_with(engine, Application, key, hash_of(request))):
        return earlier, False
    application, first = prepare(engine, settings, request, owner, key)
    try:
        with engine.begin() as connection:
            refuse_when_full(connection, settings, owner, len(first.jobs))
            open_first(connection, application, first)
    except IntegrityError:
        if key is None:
            raise
        earlier = earlier_with(engine, Application, key, application.request_hash)  # another with the key came first
        if earlier is None:
            raise
        return earlier, False
    log.info("application accepted", application=application.id, jobs=len(first.jobs))
    return application.id, True


def prepare(
    engine: Engine, settings: Settings, request: ApplicationRequest, owner: Owner, key: str | None = None
) -> tuple[NewApplication, NextStage]:
    """Check a request and make its row, with the stage it begins with; nothing is stored yet.

    Raises
    ------
    InvalidInputError
    """
    resolved = resolve(request, lambda robot_id: find_robot(engine, robot_id, owner), settings.max_tasks)
    refuse_long_trajectories(settings, resolved)
    content = request.model_dump(mode="json")
    application = NewApplication(
        id=new_id(),
        name=request.name,
        request=content,
        resolved=resolved.model_dump(mode="json"),
        versions=versions(),
        tags=list(request.tags),
        request_hash="" if key is None else _hash(content),
        idempotency_key=key,
        owner=owner,
    )
    return application, plan_first(resolved)


def find_robot(engine: Engine, robot_id: str, owner: Owner = None) -> Mapping[str, Any] | None:
    """The wire form of an uploaded robot that an owner sees."""
    mine = owned_by(owner, UploadedRobot.owner)
    with reading(engine) as session:
        return session.scalar(select(UploadedRobot.wire).where(UploadedRobot.id == robot_id, mine))


def hash_of(request: BaseModel) -> str:
    """Tells two requests apart that come with the same idempotency key."""
    return _hash(request.model_dump(mode="json"))


def _hash(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def key_of_owner(key: str, owner: Owner) -> str:
    """Two owners may have thought of the same idempotency key."""
    return key if owner is None else f"{owner}:{hashlib.sha256(key.encode()).hexdigest()}"


def earlier_with(engine: Engine, table: type[Application | Sweep], key: str, request_hash: str) -> str | None:
    """The id of what was submitted with this key before.

    Raises
    ------
    IdempotencyConflictError
        It was another request.
    """
    with reading(engine) as session:
        row = session.execute(select(table.id, table.request_hash).where(table.idempotency_key == key)).one_or_none()
    if row is None:
        return None
    if row.request_hash != request_hash:
        raise IdempotencyConflictError("this Idempotency-Key was used with another body")
    return str(row.id)
