"""Known results that an example is compared with: a file `NAME.reference.json` beside `NAME.yaml`."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from armature.errors import ApplicationFileError

SUFFIX = ".reference.json"


class Reference(BaseModel):
    """Totals of methods, optima of single tasks, and why one's own may differ."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    source: str = Field(description="where the numbers come from")
    unit: str = Field(description="s or V2 s")
    totals: dict[str, float] = Field(default_factory=dict, description="by method; `own`: each task its own design")
    tasks: dict[str, float] = Field(default_factory=dict, description="own optima, by the task's name")
    explanations: dict[str, str] = Field(default_factory=dict, description="by method, shown when a total differs")


def reference_beside(file: Path) -> Reference | None:
    """The reference of an application's file, if there is one.

    Raises
    ------
    ApplicationFileError
        There is one, and it cannot be read.
    """
    path = file.with_suffix(SUFFIX)
    if not path.exists():
        return None
    try:
        return Reference.model_validate_json(path.read_text(encoding="utf-8"))
    except ValidationError as error:
        raise ApplicationFileError(f"{path} is not a reference: {error}") from error
