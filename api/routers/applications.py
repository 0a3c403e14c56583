"""Submit, poll, list, cancel and delete applications."""

from __future__ import annotations

import hashlib
from functools import partial
from typing import Annotated

from anyio import to_thread
from fastapi import APIRouter, Header, Query, Request, Response

from api.access import OwnerOf
from api.context import Ctx
from services.jobs import listing, views
from services.jobs.cancel import cancel, delete_application
from services.jobs.retry import retry
from services.jobs.stop_search import stop_search
from services.jobs.submit import submit
from services.jobs.views import NotFoundError
from shared.contracts.application import ApplicationRequest
from shared.contracts.states import Accepted, ApplicationList, ApplicationStatus
from shared.domain import ApplicationState

router = APIRouter(prefix="/v1/applications", tags=["applications"])

POLL_AFTER_S = "1"
Limit = Annotated[int, Query(ge=1, le=1000)]


@router.post("", status_code=202)
async def submit_application(
    body: ApplicationRequest,
    response: Response,
    ctx: Ctx,
    owner: OwnerOf,
    idempotency_key: Annotated[str | None, Header(min_length=1, max_length=200)] = None,
) -> Accepted:
    """Validate and store an application; its jobs start as workers are free."""
    work = partial(submit, ctx.engine, ctx.settings, body, idempotency_key, owner)
    application_id, new = await to_thread.run_sync(work, limiter=ctx.submitting)
    url = f"/v1/applications/{application_id}"
    response.headers["Location"], response.headers["Retry-After"] = url, POLL_AFTER_S
    seen = partial(views.state_of, ctx.engine, application_id)
    state = ApplicationState.QUEUED if new else await to_thread.run_sync(seen)
    return Accepted(id=application_id, state=state, url=url)


@router.get("")
def list_applications(
    ctx: Ctx,
    owner: OwnerOf,
    cursor: str | None = None,
    limit: Limit = 50,
    *,
    state: ApplicationState | None = None,
    tag: str | None = None,
    name: Annotated[str | None, Query(min_length=1, description="part of the name, in any case")] = None,
) -> ApplicationList:
    """Applications, newest first."""
    return listing.list_applications(ctx.engine, cursor, limit, listing.Filters(state, tag, name, owner))


@router.get(
    "/{application_id}",
    response_model=ApplicationStatus,
    responses={304: {"description": "unchanged since the ETag in `If-None-Match`"}},
)
def get_application(application_id: str, request: Request, ctx: Ctx) -> Response:
    """An application as it stands; `If-None-Match` saves the body while nothing has changed."""
    status = views.status(ctx.engine, application_id)
    stable = status.model_copy(update={"progress": status.progress.model_copy(update={"eta_s": None})})
    tag = f'"{hashlib.sha256(stable.model_dump_json().encode()).hexdigest()[:16]}"'
    headers = {"ETag": tag}
    if not ApplicationState(status.state).final:
        headers["Retry-After"] = POLL_AFTER_S
    if request.headers.get("if-none-match") == tag:
        return Response(status_code=304, headers=headers)
    return Response(status.model_dump_json(), headers=headers, media_type="application/json")


@router.post("/{application_id}/cancel", status_code=202)
def cancel_application(application_id: str, ctx: Ctx) -> ApplicationStatus:
    """Cancel: queued jobs at once, running ones within a second or two. What is final stays as it is."""
    if not cancel(ctx.engine, application_id):
        raise NotFoundError(f"there is no application {application_id}")
    return views.status(ctx.engine, application_id)


@router.post("/{application_id}/stop_search", status_code=202)
def stop_search_of_application(application_id: str, ctx: Ctx) -> ApplicationStatus:
    """End the search for a shared design with the best one found so far; the application goes on with that."""
    if not stop_search(ctx.engine, application_id):
        raise NotFoundError(f"there is no application {application_id}")
    return views.status(ctx.engine, application_id)


@router.post("/{application_id}/retry", status_code=202)
def retry_application(application_id: str, ctx: Ctx) -> ApplicationStatus:
    """Do again what failed, died or was cancelled, and what depends on it; results that stay valid are kept."""
    if not retry(ctx.engine, application_id):
        raise NotFoundError(f"there is no application {application_id}")
    return views.status(ctx.engine, application_id)


@router.delete("/{application_id}", status_code=204)
def remove_application(application_id: str, ctx: Ctx) -> None:
    """Delete an application with all it owns."""
    if not delete_application(ctx.engine, application_id):
        raise NotFoundError(f"there is no application {application_id}")
