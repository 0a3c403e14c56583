"""A listener that leaves in the middle of an event stream is no error.

The framework says so as an exception, of the server's or of its own closed pipe, which would be logged as one.
"""

from __future__ import annotations

import anyio
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

EVENT_STREAM = b"text/event-stream"


class Listeners:
    """ASGI middleware: ends a stream in silence when nobody listens any more."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on."""
        streaming = False

        async def watched(message: Message) -> None:
            nonlocal streaming
            if message["type"] == "http.response.start":
                streaming = any(value.startswith(EVENT_STREAM) for _, value in message["headers"])
            await send(message)

        try:
            await self.app(scope, receive, watched)
        except* (anyio.BrokenResourceError, ClientDisconnect):
            if not streaming:
                raise
