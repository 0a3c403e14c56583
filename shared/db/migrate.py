"""Bring a database to the newest revision, or back."""

from __future__ import annotations

import os
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.script import ScriptDirectory
from sqlalchemy import make_url

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


def is_known(revision: str) -> bool:
    """Whether this code has a revision; a newer version's it has not."""
    return revision in {script.revision for script in ScriptDirectory(str(MIGRATIONS)).walk_revisions()}


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
