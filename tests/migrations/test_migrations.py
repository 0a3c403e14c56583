"""Migrations run on both databases, and give what the models declare."""

from __future__ import annotations

import pytest
from alembic import command
from sqlalchemy import inspect

from shared.db.engine import make_engine
from shared.db.migrate import alembic_config, downgrade, upgrade
from shared.db.revision import HEAD, current_revision, require_head
from shared.db.tables import Base


def test_upgrade_gives_the_models_and_downgrade_takes_all_back(database_url: str) -> None:
    upgrade(database_url)
    engine = make_engine(database_url)
    try:
        assert current_revision(engine) == HEAD
        assert set(inspect(engine).get_table_names()) == {*Base.metadata.tables, "alembic_version"}
        command.check(alembic_config(database_url))  # raises when models and tables differ
        upgrade(database_url)
        downgrade(database_url, "base")
        assert inspect(engine).get_table_names() == ["alembic_version"]
    finally:
        engine.dispose()


def test_a_database_at_another_revision_is_named(database_url: str) -> None:
    upgrade(database_url, "0001")
    with pytest.raises(SystemExit, match=f"at revision 0001, this version needs {HEAD}: run 'armature"):
        require_head(database_url)
    upgrade(database_url)
    require_head(database_url)
