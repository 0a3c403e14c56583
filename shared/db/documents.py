"""JSON that the database puts together, of values that it has itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy import JSON, ColumnElement, literal_column
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.functions import FunctionElement


class json_object(FunctionElement[Any]):  # noqa: N801 - reads like SQL's own functions
    """An object with these members."""

    type = JSON()
    inherit_cache = True

    def __init__(self, members: Mapping[str, ColumnElement[Any]]) -> None:
        super().__init__(*(part for name, value in members.items() for part in (literal_column(f"'{name}'"), value)))


@compiles(json_object, "sqlite")
def _sqlite(element: Any, compiler: Any, **options: Any) -> str:
    return f"json_object({compiler.process(element.clauses, **options)})"


@compiles(json_object, "postgresql")
def _postgresql(element: Any, compiler: Any, **options: Any) -> str:
    return f"json_build_object({compiler.process(element.clauses, **options)})"
