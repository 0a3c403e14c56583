"""The application factory."""

from __future__ import annotations

import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from importlib.metadata import version

import structlog
from fastapi import FastAPI, Request, Response

from api.context import Context
from api.errors import install_error_handlers
from api.limits import BodyLimit
from api.routers import applications, health, results, robots
from shared.db.engine import make_engine
from shared.dispatch.broker import celery_app
from shared.domain import new_id
from shared.settings import Settings

log = structlog.get_logger()

DESCRIPTION = """Co-design of robot-arm motors and motions: submit an application (tasks for an arm, an objective),
poll it, fetch its design. Every quantity carries its unit in its name."""


def create_app(settings: Settings | None = None) -> FastAPI:
    """Make the API; the database has to be at its newest revision (`shared.db.migrate.upgrade`)."""
    settings = settings or Settings()
    context = Context(settings, make_engine(settings.database_url), celery_app(settings.broker_url))

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        yield
        context.engine.dispose()

    app = FastAPI(
        title="Armature",
        version=version("armature-codesign"),
        description=DESCRIPTION,
        lifespan=lifespan,
        docs_url=None,  # its pages load scripts from elsewhere
        redoc_url=None,
        openapi_url="/v1/openapi.json",
    )
    app.state.context = context
    install_error_handlers(app)
    app.middleware("http")(_log_requests)
    app.add_middleware(BodyLimit, most=settings.max_body_bytes)
    for router in (applications.router, results.router, robots.router, health.router):
        app.include_router(router)
    return app


async def _log_requests(request: Request, call_next: Callable[[Request], Awaitable[Response]]) -> Response:
    """One line a request, with an id that the answer carries too."""
    request_id, began = new_id(), time.perf_counter()
    with structlog.contextvars.bound_contextvars(request=request_id):
        response = await call_next(request)
        milliseconds = round(1e3 * (time.perf_counter() - began), 1)
        log.info("request", method=request.method, path=request.url.path, status=response.status_code, ms=milliseconds)
    response.headers["X-Request-Id"] = request_id
    return response
