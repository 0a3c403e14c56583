"""Liveness, readiness, metrics."""

from __future__ import annotations

from typing import Any, Literal

from fastapi import APIRouter, Response
from fastapi.responses import PlainTextResponse
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from pydantic import BaseModel, Field
from sqlalchemy.exc import SQLAlchemyError

from api.context import Context, Ctx
from services.jobs.queue import queue_depth
from shared.db.revision import revision_problem
from shared.dispatch.broker import broker_reachable

router = APIRouter(tags=["operations"])

BROKER_TIMEOUT_S = 2.0


@router.get("/livez")
def livez() -> dict[str, str]:
    """The process answers."""
    return {"status": "alive"}


class Readiness(BaseModel):
    """Whether work can be taken, and what waits; the counts are null when the database cannot be asked."""

    status: Literal["ready", "not ready"]
    database: str = Field(description="`ok`, or what is wrong")
    broker: str = Field(description="`ok`, or what is wrong")
    queued_jobs: int | None = None
    running_jobs: int | None = None
    oldest_queued_age_s: float | None = None


@router.get("/readyz", responses={503: {"model": Readiness, "description": "not ready"}})
def readyz(response: Response, ctx: Ctx) -> Readiness:
    """Whether work can be taken: database at its newest revision, broker reachable; how long the queue has waited."""
    checks = _checks(ctx)
    ready = checks["database"] == "ok" and checks["broker"] == "ok"
    response.status_code = 200 if ready else 503
    return Readiness(status="ready" if ready else "not ready", **checks)


def _checks(ctx: Context) -> dict[str, Any]:
    checks: dict[str, Any] = {}
    try:
        problem = revision_problem(ctx.engine)
        checks["database"] = problem or "ok"
        if problem is None:
            depth = queue_depth(ctx.engine)
            checks |= {
                "queued_jobs": depth.queued,
                "running_jobs": depth.running,
                "oldest_queued_age_s": depth.oldest_queued_age_s,
            }
    except SQLAlchemyError as error:
        checks["database"] = f"cannot be reached: {type(error).__name__}"
    checks["broker"] = "ok" if broker_reachable(ctx.broker, BROKER_TIMEOUT_S) else "cannot be reached"
    return checks


@router.get("/metrics", response_class=PlainTextResponse)
def metrics(ctx: Ctx) -> Response:
    """Prometheus: the queue, from the database; requests, of this process."""
    return Response(generate_latest(ctx.registry), media_type=CONTENT_TYPE_LATEST)
