"""Many rows as one parameter.

A statement with the values of each of a hundred rows has hundreds of parameters, and another text for every other
number of rows: it is put together, parsed and planned each time. A JSON array is one parameter, which the database
takes apart, and the statement stays the same.
"""

from __future__ import annotations

from typing import Any

from sqlalchemy import JSON, ColumnElement, bindparam, column
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.functions import FunctionElement


class elements(FunctionElement[Any]):  # noqa: N801 - reads like SQL's own functions
    """The entries of a JSON array, a row each."""

    inherit_cache = True


@compiles(elements, "sqlite")
def _sqlite(element: Any, compiler: Any, **options: Any) -> str:
    return f"json_each({compiler.process(element.clauses, **options)})"


@compiles(elements, "postgresql")
def _postgresql(element: Any, compiler: Any, **options: Any) -> str:
    return f"json_array_elements({compiler.process(element.clauses, **options)})"


def entry(parameter: str) -> ColumnElement[Any]:
    """An entry of a list that is given as a parameter; what selects it, selects a row for each.

    Of a list of lists, `entry("rows")[0].as_string()` is the first of each.
    """
    found: ColumnElement[Any] = elements(bindparam(parameter, type_=JSON)).table_valued(column("value", JSON)).c.value
    return found
