"""What people send: fields that nobody knows are refused, and named with those that were probably meant."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, ModelWrapValidatorHandler, ValidationError, model_validator
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

MOST_SUGGESTED = 3
SLIP = "unknown_field"
"""Kind of error, told first: where a name is mistyped, the field that was meant is missing as well."""
LIKE_ENOUGH = 0.6
"""Ratio of `difflib` from which a name is taken for a slip of another."""


class Strict(BaseModel):
    """Unknown fields, numbers in quotes, NaN and infinity are refused; values do not change after validation."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)

    @model_validator(mode="wrap")
    @classmethod
    def _suggest(cls, value: Any, validate: ModelWrapValidatorHandler[Self]) -> Self:
        try:
            return validate(value)
        except ValidationError as error:
            details = [_with_suggestion(detail, cls.model_fields) for detail in error.errors(include_url=False)]
            slips_first = sorted(details, key=lambda detail: _kind(detail) != SLIP)
            raise ValidationError.from_exception_data(error.title, slips_first) from None


def unknown_field(name: str, known: Iterable[str]) -> str:
    """What is wrong with a field that is not known: the names it is likest to, or else all that there are."""
    known = list(known)
    likest = get_close_matches(name, known, MOST_SUGGESTED, LIKE_ENOUGH)
    if likest:
        return f"unknown field; did you mean {' or '.join(likest)}?"
    return f"unknown field; known are {', '.join(known)}"


def _kind(detail: InitErrorDetails) -> str:
    return detail["type"].type if isinstance(detail["type"], PydanticCustomError) else detail["type"]


def _with_suggestion(detail: ErrorDetails, known: Iterable[str]) -> InitErrorDetails:
    """The same error; of a field that this very model does not know, with suggestions.

    Its kind and its words stay; pydantic's own kinds cannot be raised again with the words they were given.
    """
    kind, words = detail["type"], detail["msg"]
    if kind == "extra_forbidden" and len(detail["loc"]) == 1:
        kind, words = SLIP, unknown_field(str(detail["loc"][0]), known)
    return InitErrorDetails(type=PydanticCustomError(kind, words), loc=detail["loc"], input=detail["input"])
