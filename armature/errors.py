"""What can go wrong between a person and a server, each with what the server said."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import httpx

from armature.retry_after import retry_after_s


class ArmatureError(Exception):
    """Base of every error that this package raises on purpose; its text is for people."""


class ServerUnreachableError(ArmatureError):
    """Nobody answers at the server's address."""

    def __init__(self, url: str, reason: str) -> None:
        super().__init__(f"no server answers at {url}: {reason}")
        self.url, self.reason = url, reason


class UnexpectedAnswerError(ArmatureError):
    """What answers is no Armature server, or one of another version."""

    def __init__(self, url: str, expected: str) -> None:
        super().__init__(f"the answer of {url} is not {expected}: no Armature server, or one of another version")


class ApplicationFileError(ArmatureError):
    """A file is not there, or is not YAML of an application."""


class MissingExtraError(ArmatureError):
    """An optional part is not installed."""

    def __init__(self, what: str, extra: str) -> None:
        super().__init__(f"{what} need the extra '{extra}': pip install 'armature-codesign[{extra}]'")


@dataclass(frozen=True)
class FieldProblem:
    """One thing wrong with an input: the field, the value that was given, the limit it broke."""

    field: str
    value: Any
    limit: str
    message: str

    @classmethod
    def from_wire(cls, wire: Mapping[str, Any]) -> FieldProblem:
        """Read one of a problem document's `errors`."""
        return cls(str(wire["field"]), wire.get("value"), str(wire["limit"]), str(wire.get("message", "")))


class ProblemError(ArmatureError):
    """The server answered with a problem document (RFC 9457).

    Attributes
    ----------
    status
        HTTP status.
    detail
        What is wrong, for a person.
    errors
        Each field that was refused, empty for other problems.
    document
        The whole document.
    """

    def __init__(self, status: int, document: Mapping[str, Any]) -> None:
        self.status = status
        self.document = dict(document)
        self.detail = str(document.get("detail") or document.get("title") or f"HTTP {status}")
        self.errors = tuple(FieldProblem.from_wire(error) for error in document.get("errors", ()))
        super().__init__(self.detail)


class RefusedError(ProblemError):
    """An input was refused, and nothing of it was stored."""


class NotFoundError(ProblemError):
    """There is no such application, task or result."""


class ConflictError(ProblemError):
    """An idempotency key belongs to another request."""


class AccessError(ProblemError):
    """The server asks for an API key, or does not know the one it was shown."""


class TooManyRequestsError(ProblemError):
    """The server wants fewer requests, or fewer jobs in its queue, for now.

    Attributes
    ----------
    retry_after_s
        After how long it wants to be asked again [s]; None: it does not say.
    """

    def __init__(self, status: int, document: Mapping[str, Any], retry_after_s: float | None = None) -> None:
        super().__init__(status, document)
        self.retry_after_s = retry_after_s


TOO_MANY = 429
_BY_STATUS: dict[int, type[ProblemError]] = {
    400: RefusedError,
    401: AccessError,
    403: AccessError,
    404: NotFoundError,
    409: ConflictError,
    413: RefusedError,
    422: RefusedError,
}


def problem_of(response: httpx.Response) -> ProblemError:
    """The exception for an answer that is not a success."""
    try:
        document = response.json()
    except ValueError:
        document = None
    if not isinstance(document, dict):
        document = {"detail": f"HTTP {response.status_code} {response.reason_phrase}: {response.text[:200]}"}
    if response.status_code == TOO_MANY:
        return TooManyRequestsError(TOO_MANY, document, retry_after_s(response))
    return _BY_STATUS.get(response.status_code, ProblemError)(response.status_code, document)
