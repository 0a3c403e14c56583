"""Several statements in one round trip, where the database can."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

from sqlalchemy import Connection, Insert, Select, Update, select


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

    def __init__(self, **statements: Insert | Update) -> None:
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
        queries = {name: statement.cte(name) for name, statement in self._statements.items()}
        answers = [
            select(*queries[name].c).scalar_subquery().label(name)
            for name, statement in self._statements.items()
            if statement._returning
        ]
        return select(*answers).add_cte(*queries.values())

    def _parameters(self, connection: Connection) -> dict[str, list[str]]:
        """Names of the parameters of each statement; those with a value of their own are left out."""
        if self._known_parameters is None:
            self._known_parameters = {
                name: [key for key, bind in statement.compile(connection).binds.items() if bind.required]
                for name, statement in self._statements.items()
            }
        return self._known_parameters

    _known_parameters: dict[str, list[str]] | None = None
