"""Logging a browser in and out, since its event streams can send no header."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from pydantic import BaseModel, ConfigDict, Field
from starlette.responses import JSONResponse

from api.access import COOKIE, session_token, shown_key
from api.context import Ctx
from api.errors import problem
from services.jobs.keys import close_session, key_of, open_session

router = APIRouter(prefix="/v1/session", tags=["session"])


class Login(BaseModel):
    """What is shown once."""

    model_config = ConfigDict(extra="forbid")

    key: str = Field(min_length=1, max_length=200)


class SessionInfo(BaseModel):
    """Who is logged in."""

    keys_required: bool
    name: str | None = Field(description="of the key that is shown; null: none")


@router.get("")
def who_am_i(request: Request, ctx: Ctx) -> SessionInfo:
    """Whether keys are asked for, and the name of the one that this request shows."""
    if not ctx.settings.api_keys_required:
        return SessionInfo(keys_required=False, name=None)
    key = shown_key(ctx, request.headers)
    return SessionInfo(keys_required=True, name=None if key is None else key.name)


@router.post("", status_code=204, responses={401: {"description": "no such key"}})
def log_in(body: Login, request: Request, ctx: Ctx) -> Response:
    """Show a key once; the answer sets a cookie that scripts cannot read and other sites cannot send."""
    key = key_of(ctx.engine, body.key.strip())
    if key is None:
        refused: JSONResponse = problem(401, "this key is unknown, or was revoked")
        return refused
    answer = Response(status_code=204)
    answer.set_cookie(
        COOKIE,
        open_session(ctx.engine, key.id, ctx.settings.session_hours),
        max_age=round(3600 * ctx.settings.session_hours),
        httponly=True,
        samesite="strict",
        secure=request.url.scheme == "https",
    )
    return answer


@router.delete("", status_code=204)
def log_out(request: Request, ctx: Ctx) -> Response:
    """End the browser's session, here and in the database."""
    token = session_token(request.headers)
    if token is not None:
        close_session(ctx.engine, token)
    answer = Response(status_code=204)
    answer.delete_cookie(COOKIE, httponly=True, samesite="strict")
    return answer
