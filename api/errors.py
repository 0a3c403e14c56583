"""Errors as RFC 9457 problem documents, naming field, value and limit where an input was refused."""

from __future__ import annotations

from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from sqlalchemy.exc import OperationalError
from starlette.exceptions import HTTPException

from services.jobs.limits import QueueFullError
from services.jobs.retry import NotRetryableError
from services.jobs.stop_search import NoSearchError
from services.jobs.submit import IdempotencyConflictError
from services.jobs.views import NotFoundError
from shared.contracts.errors import FieldError, InvalidInputError, field_errors

log = structlog.get_logger()

MEDIA_TYPE = "application/problem+json"
MOST_ERRORS = 20
QUEUE_FULL_RETRY_S = "30"
NOT_ALLOWED = 405


class BrokenLimit(BaseModel):
    """One thing wrong with an input."""

    field: str = Field(description="such as tasks[3].payload_kg")
    value: str | float | bool | None = Field(description="what was given; long values are cut")
    limit: str
    message: str = Field(description="all of it, for a person")


class Problem(BaseModel):
    """An error (RFC 9457)."""

    type: str
    title: str
    status: int
    detail: str = Field(description="for a person")
    errors: list[BrokenLimit] | None = None


def problem(
    status: int, detail: str, errors: list[FieldError] | None = None, headers: Mapping[str, str] | None = None
) -> JSONResponse:
    """A problem document."""
    body: dict[str, Any] = {
        "type": "about:blank",
        "title": HTTPStatus(status).phrase,
        "status": status,
        "detail": detail,
    }
    if errors is not None:
        body["errors"] = [error.to_wire() for error in errors[:MOST_ERRORS]]
    return JSONResponse(body, status_code=status, media_type=MEDIA_TYPE, headers=headers)


def refusal(errors: list[FieldError]) -> JSONResponse:
    """422 with everything that is wrong."""
    detail = "; ".join(error.message for error in errors[:3])
    more = f"; and {len(errors) - 3} more" if len(errors) > 3 else ""
    return problem(422, detail + more, errors)


def _methods(request: Request) -> list[str]:
    """What may be asked of a path."""
    template = getattr(request.scope.get("route"), "path", "")
    return sorted(method.upper() for method in request.app.openapi()["paths"].get(template, ()))


def install_error_handlers(app: FastAPI) -> None:
    """Map every exception that use cases raise."""

    @app.exception_handler(RequestValidationError)
    async def _validation(_request: Request, error: RequestValidationError) -> JSONResponse:
        details = list(error.errors())
        if any(detail["type"] == "json_invalid" for detail in details):
            return problem(400, f"the body is not JSON: {details[0]['ctx']['error']}")
        return refusal(field_errors(details))

    @app.exception_handler(InvalidInputError)
    async def _invalid(_request: Request, error: InvalidInputError) -> JSONResponse:
        return refusal(list(error.errors))

    @app.exception_handler(NotFoundError)
    async def _not_found(_request: Request, error: NotFoundError) -> JSONResponse:
        return problem(404, str(error))

    @app.exception_handler(QueueFullError)
    async def _full(_request: Request, error: QueueFullError) -> JSONResponse:
        return problem(429, str(error), [error.error], {"Retry-After": QUEUE_FULL_RETRY_S})

    @app.exception_handler(IdempotencyConflictError)
    @app.exception_handler(NotRetryableError)
    @app.exception_handler(NoSearchError)
    async def _conflict(_request: Request, error: Exception) -> JSONResponse:
        return problem(409, str(error))

    @app.exception_handler(HTTPException)
    async def _http(request: Request, error: HTTPException) -> JSONResponse:
        headers = dict(error.headers or {})
        if error.status_code == NOT_ALLOWED and (methods := _methods(request)):
            headers["Allow"] = ", ".join(methods)  # the framework names those of the first route alone
        return problem(error.status_code, str(error.detail), headers=headers)

    @app.exception_handler(OperationalError)
    async def _database_away(_request: Request, error: OperationalError) -> JSONResponse:
        log.error("database", error=str(error.orig))
        return problem(503, "the database cannot be reached; try again", headers={"Retry-After": "5"})

    @app.exception_handler(Exception)
    async def _unexpected(_request: Request, error: Exception) -> JSONResponse:
        log.error("unexpected", error=repr(error), exc_info=error)
        return problem(500, "an unexpected error; it has been logged")
