"""The application factory."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.metadata import version

from fastapi import FastAPI
from starlette.middleware.body_limit import RequestBodyLimitMiddleware

from api import dashboard
from api.access import Access, owned
from api.context import Context
from api.errors import install_error_handlers
from api.listeners import Listeners
from api.metrics import QueueCollector, RequestMetrics
from api.openapi import describe_problems
from api.plain_text import PlainText
from api.rate_limit import RateLimit
from api.request_log import RequestLog
from api.routers import applications, events, health, report, results, robots, session, sweeps
from api.same_site import SameSite
from api.too_large import TooLarge
from api.yaml_bodies import YamlBodies
from shared.db.engine import make_engine
from shared.dispatch.broker import celery_app
from shared.settings import Settings

DESCRIPTION = """Co-design of robot-arm motors and motions: submit an application (tasks for an arm, an objective),
poll it, fetch its design. Every quantity carries its unit in its name."""


def create_app(settings: Settings | None = None) -> FastAPI:
    """Make the API; the database has to be at its newest revision (`shared.db.migrate.upgrade`)."""
    settings = settings or Settings()
    # What the API acknowledges stays acknowledged; what workers write can be done again.
    engine = make_engine(settings.database_url, outlives_power=True)
    context = Context(settings, engine, celery_app(settings.broker_url))

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
    # From the inside out.
    app.add_middleware(Listeners)
    app.add_middleware(PlainText)
    app.add_middleware(YamlBodies)
    app.add_middleware(RequestBodyLimitMiddleware, max_body_size=settings.max_body_bytes)
    app.add_middleware(TooLarge, most=settings.max_body_bytes)
    app.add_middleware(RateLimit, per_minute=settings.rate_per_minute)
    app.add_middleware(Access, context=context)
    app.add_middleware(SameSite)
    app.add_middleware(RequestLog)
    app.add_middleware(RequestMetrics, registry=context.registry)
    context.registry.register(QueueCollector(context.engine, settings.lease_s))
    for router in (applications.router, events.router, results.router, report.router, robots.router, sweeps.router):
        app.include_router(router, dependencies=[owned])
    for router in (session.router, health.router):
        app.include_router(router)
    dashboard.install(app)
    describe_problems(app)
    return app
