"""Server-sent events of an application: job states, stages, solver iterations. Resumable by id."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Depends, Header, Query
from fastapi.sse import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool

from api.context import Ctx
from services.jobs.events import events_after

router = APIRouter(prefix="/v1/applications/{application_id}", tags=["applications"])

POLL_S = 0.3
MOST = 2**31 - 1
"""Largest number that the database has for an event."""


def _known(application_id: str, ctx: Ctx) -> None:
    """Answers 404 before the stream begins."""
    events_after(ctx.engine, application_id, 0)


@router.get("/events", response_class=EventSourceResponse, dependencies=[Depends(_known)])
async def follow(
    application_id: str,
    ctx: Ctx,
    after: Annotated[int, Query(ge=0, le=MOST)] = 0,
    last_event_id: Annotated[int | None, Header(ge=0, le=MOST)] = None,
) -> AsyncIterator[ServerSentEvent]:
    """Events from the first, or after `Last-Event-ID` (or `after`), until the application is final.

    An event `pruned` says that older ones were asked for than are kept; the status has the whole picture.
    """
    number = after if last_event_id is None else last_event_id
    while True:
        found = await run_in_threadpool(events_after, ctx.engine, application_id, number)
        if found.pruned:
            yield ServerSentEvent(event="pruned", data={"oldest": found.items[0].number})
        for item in found.items:
            number = item.number
            yield ServerSentEvent(id=str(number), event=item.kind, data=item.content)
        if found.ended:
            return
        if not found.items:
            await asyncio.sleep(POLL_S)
