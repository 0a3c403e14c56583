"""How a bad input is refused: the field, the value, and the limit it broke."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from shared.contracts.application import UNION_TAGS

LONGEST_VALUE = 120
"""Characters of an offending value that are quoted back."""


NOT_FIELDS = UNION_TAGS | {"body"}
"""Parts of pydantic's error locations that no person wrote."""


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
    text = printable(value if isinstance(value, str) else repr(value))
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}..."


def printable(text: str) -> str:
    """Text that UTF-8 can carry, whatever a JSON document held."""
    return text.encode("utf-8", "backslashreplace").decode().replace("\0", "\\0")


def field_path(location: Iterable[Any]) -> str:
    """``("tasks", 3, "payload_kg")`` -> ``tasks[3].payload_kg``."""
    path = ""
    for part in (printable(part) if isinstance(part, str) else part for part in location):
        path += f"[{part}]" if isinstance(part, int) else (f".{part}" if path else str(part))
    return path or "body"


def field_errors(error: ValidationError | Iterable[Any]) -> list[FieldError]:
    """Field errors of a pydantic refusal (or of its `errors()`)."""
    details = error.errors(include_url=False) if isinstance(error, ValidationError) else error
    return [_field_error(detail) for detail in details]


def _field_error(detail: Mapping[str, Any]) -> FieldError:
    location = [part for part in detail["loc"] if part not in NOT_FIELDS]
    kind, message = detail["type"], detail["msg"].removeprefix("Value error, ")
    if kind == "missing":
        return FieldError(field_path(location), None, "is missing")
    if kind == "extra_forbidden":
        return FieldError(field_path(location), detail["input"], "unknown field")
    return FieldError(field_path(location), detail["input"], message[:1].lower() + message[1:])
