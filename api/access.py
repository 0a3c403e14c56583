"""Who is asking: an API key in `Authorization: Bearer ...`, or the cookie of a browser that showed one.

Everything under /v1 is closed unless `OPEN` says otherwise, so a new route cannot be forgotten; the same for what a
path names, which `refuse_others` looks up. Keys are off by default; then there is no owner, and nothing is asked.
"""

from __future__ import annotations

from http.cookies import CookieError, SimpleCookie
from typing import Annotated, Final

import structlog
from fastapi import Depends, Request
from sqlalchemy.exc import OperationalError
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from api.context import Context, Ctx
from api.errors import problem
from services.jobs.keys import KeyInfo, key_of, key_of_session
from services.jobs.owners import Owner, refuse_others

COOKIE: Final = "armature_session"
CLOSED: Final = "/v1/"
OPEN: Final = frozenset({"/v1/openapi.json", "/v1/session"})
"""Under /v1, and yet for everybody: the description of the interface, and logging in."""

BEARER: Final = "bearer "


class Access:
    """ASGI middleware: 401 for whoever shows no key, before a body is read."""

    def __init__(self, app: ASGIApp, context: Context) -> None:
        self.app, self.context = app, context

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on with its owner, or refuse it."""
        required = self.context.settings.api_keys_required
        if scope["type"] != "http" or not required or not scope["path"].startswith(CLOSED) or scope["path"] in OPEN:
            await self.app(scope, receive, send)
            return
        try:
            key = await run_in_threadpool(shown_key, self.context, Headers(scope=scope))
        except OperationalError:
            await problem(503, "the database cannot be reached; try again", headers={"Retry-After": "5"})(
                scope, receive, send
            )
            return
        if key is None:
            detail = "an API key is needed: Authorization: Bearer KEY (an operator makes one: armature key create NAME)"
            await problem(401, detail, headers={"WWW-Authenticate": "Bearer"})(scope, receive, send)
            return
        scope.setdefault("state", {})["owner"] = key.id
        with structlog.contextvars.bound_contextvars(key=key.id):
            await self.app(scope, receive, send)


def shown_key(context: Context, headers: Headers) -> KeyInfo | None:
    """The valid key that a request shows, in its header or by its cookie."""
    authorization = headers.get("authorization")
    if authorization is not None:
        named = authorization[: len(BEARER)].lower() == BEARER
        return key_of(context.engine, authorization[len(BEARER) :].strip()) if named else None
    token = session_token(headers)
    return None if token is None else key_of_session(context.engine, token)


def session_token(headers: Headers) -> str | None:
    """What a browser keeps after logging in."""
    try:
        cookie = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        return None
    return None if cookie is None else cookie.value


async def _owner(request: Request, ctx: Ctx) -> Owner:
    owner: Owner = getattr(request.state, "owner", None)
    if owner is not None:
        await run_in_threadpool(refuse_others, ctx.engine, owner, request.path_params)
    return owner


OwnerOf = Annotated[Owner, Depends(_owner)]
"""For a route: who asks, after a look at whether what the path names is theirs."""

owned = Depends(_owner)
"""For a router: 404 for what belongs to others, on all of its routes."""
