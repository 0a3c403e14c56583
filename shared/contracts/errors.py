"""How a bad input is refused: the field, the value, and the limit it broke."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

LONGEST_VALUE = 120
"""Characters of an offending value that are quoted back."""


@dataclass(frozen=True)
class FieldError:
    """One thing wrong with an input."""

    field: str  # path such as tasks[3].payload_kg
    value: Any
    limit: str  # what it has to be

    @property
    def message(self) -> str:
        """For a person."""
        return (
            f"{self.field} = {quoted(self.value)}: {self.limit}" if self.value is not None else self.text_without_value
        )

    @property
    def text_without_value(self) -> str:
        """The message of a field that is missing."""
        return f"{self.field}: {self.limit}"

    def to_wire(self) -> dict[str, Any]:
        """JSON form."""
        return {"field": self.field, "value": quoted(self.value), "limit": self.limit, "message": self.message}


class InvalidInputError(Exception):
    """An input was refused; nothing of it was stored."""

    def __init__(self, errors: Iterable[FieldError]) -> None:
        self.errors = tuple(errors)
        super().__init__("; ".join(error.message for error in self.errors))


def quoted(value: Any) -> Any:
    """An offending value as JSON can carry it: NaN as text, long values cut."""
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    text = value if isinstance(value, str) else repr(value)
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}..."


def field_path(location: Iterable[Any]) -> str:
    """``("tasks", 3, "payload_kg")`` -> ``tasks[3].payload_kg``."""
    path = ""
    for part in location:
        path += f"[{part}]" if isinstance(part, int) else (f".{part}" if path else str(part))
    return path or "body"


def field_errors(error: ValidationError | list[Any], skip: frozenset[str] = frozenset()) -> list[FieldError]:
    """Field errors of a pydantic refusal; `skip` names location parts that are not fields (union branches)."""
    details: list[Any] = error if isinstance(error, list) else list(error.errors(include_url=False))
    return [_field_error(detail, skip) for detail in details]


def _field_error(detail: Mapping[str, Any], skip: frozenset[str]) -> FieldError:
    location = [part for part in detail["loc"] if part not in skip]
    kind, message = detail["type"], detail["msg"].removeprefix("Value error, ")
    if kind == "missing":
        return FieldError(field_path(location), None, "is missing")
    if kind == "extra_forbidden":
        return FieldError(field_path(location), detail["input"], "unknown field")
    return FieldError(field_path(location), detail["input"], message[:1].lower() + message[1:])
