"""Alembic's environment: the database comes from `shared.db.migrate`, or from the settings for the command line."""

from __future__ import annotations

from alembic import context
from sqlalchemy import text

from shared.db.engine import make_engine
from shared.db.tables import Base
from shared.settings import Settings

MIGRATION_LOCK = 7213905331
"""Key of the Postgres advisory lock that lets one process migrate at a time."""


def run() -> None:
    """Migrate over one connection in one transaction."""
    url = context.config.attributes.get("database_url") or Settings().database_url
    engine = make_engine(url)
    with engine.begin() as connection:
        if connection.dialect.name == "postgresql":
            connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": MIGRATION_LOCK})
        context.configure(
            connection=connection,
            target_metadata=Base.metadata,
            render_as_batch=True,
            compare_type=True,
            compare_server_default=False,
        )
        context.run_migrations()
    engine.dispose()


run()
