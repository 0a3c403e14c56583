"""What every route needs, kept on the application and handed to routes by FastAPI."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, cast

import anyio
from celery import Celery
from fastapi import Depends, Request
from prometheus_client import CollectorRegistry
from sqlalchemy import Engine

from shared.settings import Settings

MOST_SUBMITTING = 4
"""One submission computes while others wait for the database. More would not end sooner: they would take the
interpreter from the questions between them, and SQLite, which has one writer, makes those that wait sleep."""


@dataclass(frozen=True)
class Context:
    """Settings, database and broker of one API process."""

    settings: Settings
    engine: Engine
    broker: Celery
    registry: CollectorRegistry = field(default_factory=CollectorRegistry)
    """Metrics of this process."""
    drawing: anyio.CapacityLimiter = field(default_factory=lambda: anyio.CapacityLimiter(1))
    """One report is drawn at a time; the others wait."""
    submitting: anyio.CapacityLimiter = field(default_factory=lambda: anyio.CapacityLimiter(MOST_SUBMITTING))
    """So many submissions at a time; the others wait their turn."""


async def _context(request: Request) -> Context:  # a plain function would be sent to a thread
    return cast(Context, request.app.state.context)


Ctx = Annotated[Context, Depends(_context)]
