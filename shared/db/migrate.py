"""Bring a database to the newest revision, and tell whether it is there."""

from __future__ import annotations

import os
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Engine, make_url
from sqlalchemy.exc import OperationalError

from shared.db.engine import make_engine
from shared.settings import Settings

MIGRATIONS = Path(__file__).resolve().parents[2] / "migrations"


def alembic_config(database_url: str) -> Config:
    """Alembic's configuration for a database."""
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    config.attributes["database_url"] = database_url
    return config


def upgrade(database_url: str, revision: str = "head") -> None:
    """Run the migrations up to `revision`. Safe when several processes do it at once."""
    with _one_at_a_time(database_url):
        command.upgrade(alembic_config(database_url), revision)


def downgrade(database_url: str, revision: str) -> None:
    """Run the migrations down to `revision` ("base": to nothing)."""
    command.downgrade(alembic_config(database_url), revision)


def head_revision() -> str:
    """Newest revision that this code knows."""
    head = ScriptDirectory(str(MIGRATIONS)).get_current_head()
    assert head is not None
    return head


def is_known(revision: str) -> bool:
    """Whether this code has a revision; a newer version's it has not."""
    return revision in {script.revision for script in ScriptDirectory(str(MIGRATIONS)).walk_revisions()}


def current_revision(engine: Engine) -> str | None:
    """Revision that a database is at; None when it is empty."""
    with engine.connect() as connection:
        return MigrationContext.configure(connection).get_current_revision()


def revision_problem(engine: Engine) -> str | None:
    """What to do about a database that this version cannot work with; None: nothing."""
    current, head = current_revision(engine), head_revision()
    if current == head:
        return None
    return (
        f"the database is at revision {current or 'none'}, this version needs {head}: "
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


class _one_at_a_time:  # noqa: N801 - used as a context manager
    """A file lock beside an SQLite database; Postgres has transactional DDL and an advisory lock in env.py."""

    def __init__(self, database_url: str) -> None:
        url = make_url(database_url)
        self._path = Path(f"{url.database}.migrating") if url.get_backend_name() == "sqlite" and url.database else None
        self._file: int | None = None

    def __enter__(self) -> None:
        if self._path is None:
            return
        import fcntl

        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._file = os.open(self._path, os.O_CREAT | os.O_RDWR)
        fcntl.flock(self._file, fcntl.LOCK_EX)

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            os.close(self._file)


def main() -> None:
    """Process entry: bring the database of the settings to the newest revision."""
    upgrade(Settings().database_url)


if __name__ == "__main__":
    main()
