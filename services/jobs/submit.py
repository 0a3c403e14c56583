"""Accept an application: resolve it, then store it with its first jobs and their messages in one transaction."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from sqlalchemy import Engine, select
from sqlalchemy.exc import IntegrityError

from services.jobs.limits import refuse_long_trajectories, refuse_when_full
from services.jobs.owners import Owner, owned_by
from services.jobs.plan import plan_first
from services.jobs.resolve import resolve
from services.jobs.store import open_stage
from services.jobs.versions import versions
from shared.contracts.application import ApplicationRequest
from shared.db.engine import reading, transaction
from shared.db.tables import Application, UploadedRobot
from shared.domain import ApplicationState, new_id
from shared.settings import Settings


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
    body = request.model_dump(mode="json")
    request_hash = hashlib.sha256(json.dumps(body, sort_keys=True).encode()).hexdigest()
    if idempotency_key is not None:
        idempotency_key = _of_owner(idempotency_key, owner)
    if idempotency_key is not None and (earlier := _earlier(engine, idempotency_key, request_hash)):
        return earlier, False
    resolved = resolve(request, lambda robot_id: find_robot(engine, robot_id, owner), settings.max_tasks)
    refuse_long_trajectories(settings, resolved)
    first = plan_first(resolved)
    application = Application(
        id=new_id(),
        name=request.name,
        state=ApplicationState.QUEUED,
        generation=0,
        request=body,
        resolved=resolved.model_dump(mode="json"),
        versions=versions(),
        tags=list(request.tags),
        idempotency_key=idempotency_key,
        request_hash=request_hash,
        owner=owner,
    )
    try:
        with transaction(engine) as session:
            refuse_when_full(session, settings, owner, len(first.jobs))
            session.add(application)
            session.flush()
            open_stage(session, application, first)
    except IntegrityError:
        if idempotency_key is None:
            raise
        earlier = _earlier(engine, idempotency_key, request_hash)  # another request with the key came first
        if earlier is None:
            raise
        return earlier, False
    return application.id, True


def find_robot(engine: Engine, robot_id: str, owner: Owner = None) -> Mapping[str, Any] | None:
    """The wire form of an uploaded robot that an owner sees."""
    mine = owned_by(owner, UploadedRobot.owner)
    with reading(engine) as session:
        return session.scalar(select(UploadedRobot.wire).where(UploadedRobot.id == robot_id, mine))


def _of_owner(key: str, owner: Owner) -> str:
    """Two owners may have thought of the same idempotency key."""
    return key if owner is None else f"{owner}:{hashlib.sha256(key.encode()).hexdigest()}"


def _earlier(engine: Engine, key: str, request_hash: str) -> str | None:
    with reading(engine) as session:
        row = session.execute(
            select(Application.id, Application.request_hash).where(Application.idempotency_key == key)
        ).one_or_none()
    if row is None:
        return None
    if row.request_hash != request_hash:
        raise IdempotencyConflictError("this Idempotency-Key was used with another body")
    return str(row.id)
