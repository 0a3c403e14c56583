"""Starlette's answer to a body over the limit, as a problem document that names the limit."""

from __future__ import annotations

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from api.errors import problem

CONTENT_TOO_LARGE = 413


class TooLarge:
    """ASGI middleware around the framework's body limit of `most` bytes."""

    def __init__(self, app: ASGIApp, most: int) -> None:
        self.app, self.most = app, most

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass everything through but a 413, which is answered in our words."""
        replaced = False

        async def translated(message: Message) -> None:
            nonlocal replaced
            if message["type"] == "http.response.start" and message["status"] == CONTENT_TOO_LARGE:
                replaced = True
                answer = problem(CONTENT_TOO_LARGE, f"the body is larger than {self.most} bytes")
                await answer(scope, receive, send)
            elif not replaced:
                await send(message)

        await self.app(scope, receive, translated)
