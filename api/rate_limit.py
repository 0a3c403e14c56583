"""How often one key, or one address where no key is shown, may ask. Counted in each API process by itself: N processes
let through N times as much at most, and no server has to be asked about every request."""

from __future__ import annotations

import math
import time

from limits import RateLimitItemPerMinute
from limits.storage import MemoryStorage
from limits.strategies import SlidingWindowCounterRateLimiter
from starlette.types import ASGIApp, Receive, Scope, Send

from api.access import CLOSED
from api.errors import problem
from shared.contracts.errors import FieldError


class RateLimit:
    """ASGI middleware around everything under /v1, inside `Access`: 429 with Retry-After over `per_minute` requests."""

    def __init__(self, app: ASGIApp, per_minute: int) -> None:
        self.app, self.per_minute = app, per_minute
        self._limit = RateLimitItemPerMinute(per_minute) if per_minute else None
        self._limiter = SlidingWindowCounterRateLimiter(MemoryStorage())

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        if self._limit is None or scope["type"] != "http" or not scope["path"].startswith(CLOSED):
            await self.app(scope, receive, send)
            return
        who = _who(scope)
        if self._limiter.hit(self._limit, who):
            await self.app(scope, receive, send)
            return
        wait = max(1, math.ceil(self._limiter.get_window_stats(self._limit, who).reset_time - time.time()))
        error = FieldError("requests", self.per_minute, f"at most {self.per_minute} a minute for one key or address")
        refused = problem(429, f"{error.limit}; try again in {wait} s", [error], {"Retry-After": str(wait)})
        await refused(scope, receive, send)


def _who(scope: Scope) -> str:
    owner = scope.get("state", {}).get("owner")
    client = scope.get("client")
    return f"key {owner}" if owner is not None else f"address {client[0] if client else ''}"
