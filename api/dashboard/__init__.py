"""The dashboard: static files that speak to the HTTP interface like anyone else. Nothing is built, nothing is fetched
from elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from fastapi import FastAPI
from starlette.responses import FileResponse, Response
from starlette.staticfiles import StaticFiles

STATIC: Final = Path(__file__).parent / "static"

CONTENT_SECURITY_POLICY: Final = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",  # no inline script, no eval
        "style-src 'self'",
        "img-src 'self' data:",
        "connect-src 'self'",
        "manifest-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",  # forms are read by our scripts, never sent by the browser
        "frame-ancestors 'none'",
    )
)

HEADERS: Final[Mapping[str, str]] = {
    "Content-Security-Policy": CONTENT_SECURITY_POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",  # kept, but asked for again: an update shows at once
}


class _Assets(StaticFiles):
    """Static files with our headers."""

    def file_response(self, *args: Any, **kwargs: Any) -> Response:
        """As the framework makes it, and headers that forbid what the pages do not need."""
        response = super().file_response(*args, **kwargs)
        response.headers.update(HEADERS)
        return response


def install(app: FastAPI) -> None:
    """Serve the page at `/` and what it needs under `/dashboard`. Its own addresses are fragments (`/#/...`), so every
    other path stays the API's to answer."""
    app.mount("/dashboard", _Assets(directory=STATIC), name="dashboard")

    @app.get("/", include_in_schema=False)
    def page() -> FileResponse:
        return FileResponse(STATIC / "index.html", headers=dict(HEADERS))
