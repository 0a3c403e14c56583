"""No other site acts through a visitor's browser: its requests that change something are refused.

A browser says where a request comes from (`Sec-Fetch-Site`, or `Origin` where it does not), and no page can make it
lie. A session's cookie is not sent from other sites anyway (`SameSite=strict`); this holds without a cookie too, for a
server on the visitor's own machine that asks for no keys.
"""

from __future__ import annotations

from typing import Final
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from api.access import CLOSED
from api.errors import problem

SAFE_METHODS: Final = frozenset({"GET", "HEAD", "OPTIONS"})
OWN: Final = frozenset({"same-origin", "none"})
"""`none`: the person typed the address."""


class SameSite:
    """ASGI middleware around everything under /v1: 403 for what another site asks a browser to do."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        if scope["type"] != "http" or scope["method"] in SAFE_METHODS or not scope["path"].startswith(CLOSED):
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        # A page elsewhere cannot set this header without asking first, and it is not asked for permission here.
        if "authorization" in headers or _from_here(headers):
            await self.app(scope, receive, send)
            return
        await problem(403, "another site asked the browser for this; only this server's own pages may")(
            scope, receive, send
        )


def _from_here(headers: Headers) -> bool:
    site = headers.get("sec-fetch-site")
    if site is not None:
        return site in OWN
    origin = headers.get("origin")
    return origin is None or urlsplit(origin).netloc == headers.get("host")  # programs send neither
