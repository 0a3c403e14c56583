"""What an examination finds."""

from __future__ import annotations

from enum import StrEnum

from pydantic import BaseModel, Field


class Level(StrEnum):
    """How bad."""

    OK = "ok"
    WARN = "warn"  # it runs, worse than it could
    FAIL = "fail"  # it does not run


class Finding(BaseModel):
    """One line of `armature doctor`."""

    subject: str
    level: Level
    found: str
    advice: str | None = Field(None, description="what to do, unless all is well")


def ok(subject: str, found: str) -> Finding:
    """All is well."""
    return Finding(subject=subject, level=Level.OK, found=found)


def warn(subject: str, found: str, advice: str) -> Finding:
    """It runs, worse than it could."""
    return Finding(subject=subject, level=Level.WARN, found=found, advice=advice)


def fail(subject: str, found: str, advice: str) -> Finding:
    """It does not run."""
    return Finding(subject=subject, level=Level.FAIL, found=found, advice=advice)
