"""Several statements in one round trip, where the database can."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

from sqlalchemy import ColumnElement, Connection, Insert, Select, Update, bindparam, insert, select

from shared.db.tables import Base, table_of

Statement = Insert | Update
Columns = Mapping[str, ColumnElement[Any]]
"""Of a row, by name."""


class Together:
    """Statements with named parameters that are sent at once.

    Postgres runs them as one, each as a data-modifying `WITH` query; SQLite, which has no such queries, and no way to
    a server that they would save, runs them one after the other. Postgres shows each of them the rows as they were
    before the first, so none may need what another wrote, nor write a row that another writes.

    Parameters
    ----------
    statements
        By name. One that returns something returns one column, of one row at most.
    """

    def __init__(self, **statements: Statement) -> None:
        self._statements = statements

    def run(self, connection: Connection, values: Mapping[str, Any]) -> dict[str, Any]:
        """Run all; for each statement that returns something, what it returned, or None where it found no row."""
        if connection.dialect.name == "postgresql":
            return dict(connection.execute(self._as_one, values).mappings().one())
        answers = {}
        for name, statement in self._statements.items():
            result = connection.execute(statement, {key: values[key] for key in self._parameters(connection)[name]})
            if statement._returning:
                answers[name] = result.scalar_one_or_none()
        return answers

    @cached_property
    def _as_one(self) -> Select[Any]:
        return _one_of(self._statements)

    def _parameters(self, connection: Connection) -> dict[str, list[str]]:
        """Names of the parameters of each statement; those with a value of their own are left out."""
        if self._known_parameters is None:
            self._known_parameters = {
                name: [key for key, bind in statement.compile(connection).binds.items() if bind.required]
                for name, statement in self._statements.items()
            }
        return self._known_parameters

    _known_parameters: dict[str, list[str]] | None = None


class WithRow:
    """A query that finds one row, or none, and locks it; and statements that need what it found.

    Postgres gets all in one. The query waits for its locks and then reads what it locked anew; each statement writes
    rows that are locked, by their newest version, and inserts what the query found. So there is nothing to be seen of
    what others did between the query and the statements, although the rest of the rows are as they were before.

    Parameters
    ----------
    found
        With `FOR UPDATE`. Its rows are all that the statements change, or what those rows keep others from changing.
    statements
        Makes them from the columns of the row: on Postgres the query's own, which give no row where it found none; on
        SQLite parameters.
    """

    def __init__(self, found: Select[Any], statements: Callable[[Columns], dict[str, Statement]]) -> None:
        self._found, self._make = found, statements

    def run(self, connection: Connection, values: Mapping[str, Any]) -> dict[str, Any] | None:
        """Run all; returns the row with the statements' answers, or None where there is no such row."""
        statement = self._as_one if connection.dialect.name == "postgresql" else self._found
        row = connection.execute(statement, values).mappings().one_or_none()
        if row is None or statement is not self._found:
            return None if row is None else dict(row)
        of_row = {_parameter(name): value for name, value in row.items()}
        return dict(row) | self._after_the_row.run(connection, {**values, **of_row})

    @cached_property
    def _as_one(self) -> Select[Any]:
        found = self._found.cte("found")
        return _one_of(self._make({column.name: column for column in found.c})).add_columns(*found.c)

    @cached_property
    def _after_the_row(self) -> Together:
        columns = self._found.selected_columns
        return Together(**self._make({str(c.name): bindparam(_parameter(c.name), type_=c.type) for c in columns}))


def _parameter(column: str) -> str:
    return f"found_{column}"


def _one_of(statements: Mapping[str, Statement]) -> Select[Any]:
    """Statements as one, which selects what they return."""
    queries = {name: statement.cte(name) for name, statement in statements.items()}
    answers = [
        select(*queries[name].c).scalar_subquery().label(name)
        for name, statement in statements.items()
        if statement._returning
    ]
    return select(*answers).add_cte(*queries.values())


def row_into(entity: type[Base], columns: Columns, *conditions: ColumnElement[bool]) -> Insert:
    """Insert a row made of other rows' columns, of parameters and constants: one for each row that they are of."""
    row = select(*columns.values()).where(*conditions)
    return insert(table_of(entity)).from_select(list(columns), row, include_defaults=False)
