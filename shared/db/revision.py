"""Which revision a database is at, and which one this version needs.

Without Alembic, whose import takes a fifth of a second that no worker should wait for.
"""

from __future__ import annotations

from sqlalchemy import Engine, column, inspect, select, table
from sqlalchemy.exc import OperationalError

from shared.db.engine import make_engine

HEAD = "0005"
"""Newest revision of `migrations`; it goes up with every one that is added."""

_VERSIONS = table("alembic_version", column("version_num"))
"""Where Alembic keeps it."""


def current_revision(engine: Engine) -> str | None:
    """Revision that a database is at; None when it is empty."""
    with engine.connect() as connection:
        if not inspect(connection).has_table(_VERSIONS.name):
            return None
        found: str | None = connection.scalar(select(_VERSIONS))
        return found


def revision_problem(engine: Engine) -> str | None:
    """What to do about a database that this version cannot work with; None: nothing."""
    current = current_revision(engine)
    if current == HEAD:
        return None
    return (
        f"the database is at revision {current or 'none'}, this version needs {HEAD}: "
        "run 'armature migrate' or the migrate job first"
    )


def require_head(database_url: str) -> None:
    """End the process with a message when the database is at another revision.

    One that cannot be reached is waited for elsewhere.
    """
    engine = make_engine(database_url)
    try:
        if problem := revision_problem(engine):
            raise SystemExit(problem)
    except OperationalError:
        return
    finally:
        engine.dispose()
