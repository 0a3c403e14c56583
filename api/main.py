"""Process entry of the API: `python -m api.main --host 127.0.0.1 --port 8000`."""

from __future__ import annotations

import argparse

import uvicorn

from api.app import create_app
from shared.db.revision import require_head
from shared.observability import configure_logging
from shared.settings import Settings

LOOPBACK = "127.0.0.1"

KEEP_ALIVE_S = 60
"""How long a connection without a request stays open: much longer than clients keep one to use it again (httpx: 5 s).
Where both are the same, a request now and then meets a connection that is closed at that moment."""


def main() -> None:
    """Serve until SIGTERM or SIGINT."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--host", default=LOOPBACK)
    parser.add_argument("--port", type=int, default=8000)
    arguments = parser.parse_args()
    configure_logging()
    settings = Settings()
    require_head(settings.database_url)
    app = create_app(settings)
    uvicorn.run(
        app,
        host=arguments.host,
        port=arguments.port,
        timeout_keep_alive=KEEP_ALIVE_S,
        access_log=False,
        log_config=None,
    )


if __name__ == "__main__":
    main()
