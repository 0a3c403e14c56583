"""Data in the tables survives every way up and down. Rows are made from what a revision declares: a new one needs
nothing here."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from alembic.script import ScriptDirectory
from sqlalchemy import (
    JSON,
    Boolean,
    Column,
    Connection,
    Float,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    inspect,
    select,
)
from sqlalchemy.types import TypeEngine

from shared.db.engine import make_engine
from shared.db.migrate import MIGRATIONS, downgrade, upgrade

ROWS = 3

VALUES: dict[type[TypeEngine[Any]], Callable[[int], Any]] = {
    Boolean: lambda k: k % 2 == 0,
    Integer: lambda k: k + 1,
    Float: lambda k: k + 0.5,
    JSON: lambda k: {"row": k},
    LargeBinary: lambda k: bytes([k]),
}
"""What a column of each type holds in row `k`; text says where it stands."""

Rows = dict[str, list[dict[str, Any]]]

REVISIONS = [script.revision for script in reversed(list(ScriptDirectory(str(MIGRATIONS)).walk_revisions()))]


@pytest.mark.parametrize("revision", REVISIONS)
def test_up_and_down_with_data(database_url: str, revision: str) -> None:
    upgrade(database_url, revision)
    fill(database_url)
    before = read(database_url)
    assert all(len(rows) == ROWS for rows in before.values())
    upgrade(database_url)
    assert only(read(database_url), before) == before
    downgrade(database_url, revision)
    assert read(database_url) == before


def test_down_with_data_that_older_revisions_do_not_know(database_url: str) -> None:
    upgrade(database_url)
    fill(database_url)
    for revision in [*reversed(REVISIONS[:-1]), "base"]:
        before = read(database_url)
        downgrade(database_url, revision)
        after = read(database_url)
        assert only(before, after) == after
    engine = make_engine(database_url)
    assert inspect(engine).get_table_names() == ["alembic_version"]
    engine.dispose()


def fill(database_url: str) -> None:
    """Some rows in every table, each with all columns set and true references."""
    engine = make_engine(database_url)
    with engine.begin() as connection:
        for table in tables(connection):
            connection.execute(
                table.insert(), [{column.name: value(column, k) for column in table.columns} for k in range(ROWS)]
            )
    engine.dispose()


def read(database_url: str) -> Rows:
    """All rows of all tables."""
    engine = make_engine(database_url)
    with engine.connect() as connection:
        found = {
            table.name: [
                dict(row) for row in connection.execute(select(table).order_by(*table.primary_key.columns)).mappings()
            ]
            for table in tables(connection)
        }
    engine.dispose()
    return found


def only(rows: Rows, known: Rows) -> Rows:
    """Tables and columns that `known` has too."""
    return {
        name: [{column: row[column] for column in known[name][k]} for k, row in enumerate(rows[name])] for name in known
    }


def tables(connection: Connection) -> list[Table]:
    """Tables as they are, referenced ones first."""
    metadata = MetaData()
    metadata.reflect(connection)
    return [table for table in metadata.sorted_tables if table.name != "alembic_version"]


def value(column: Column[Any], k: int) -> Any:
    """Something for a column of row `k`: the same for a reference and what it refers to, another in each row."""
    for reference in column.foreign_keys:
        return value(reference.column, k)
    for kind, make in VALUES.items():
        if isinstance(column.type, kind):
            return make(k)
    return f"{column.table.name}.{column.name}"[:20] + str(k)
