"""The database that the settings name, for commands that need no server."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sqlalchemy import Engine


@contextmanager
def open_database() -> Iterator[Engine]:
    """The settings' database, made where there is none yet; one at another revision is left alone."""
    from shared.db.engine import make_engine
    from shared.db.migrate import current_revision, require_head, upgrade
    from shared.settings import Settings

    url = Settings().database_url
    engine = make_engine(url)
    try:
        if current_revision(engine) is None:
            upgrade(url)
        require_head(url)
        yield engine
    finally:
        engine.dispose()
