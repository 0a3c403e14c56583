"""One log line a request, with an id that the answer carries too. Plain ASGI, so that streams stay streams."""

from __future__ import annotations

import re
import time

import structlog
from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from shared.domain import new_id

log = structlog.get_logger()

_APPLICATION = re.compile(r"/v1/applications/([0-9a-f]{22})(?:/|$)")


class RequestLog:
    """ASGI middleware."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, and log how it was answered."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        request_id, began, status = new_id(), time.perf_counter(), 500

        async def watched(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                MutableHeaders(scope=message)["X-Request-Id"] = request_id
            await send(message)

        about = _APPLICATION.match(scope["path"])
        ids = {"request": request_id} | ({"application": about[1]} if about else {})
        with structlog.contextvars.bound_contextvars(**ids):
            try:
                await self.app(scope, receive, watched)
            finally:
                milliseconds = round(1e3 * (time.perf_counter() - began), 1)
                log.info("request", method=scope["method"], path=scope["path"], status=status, ms=milliseconds)
