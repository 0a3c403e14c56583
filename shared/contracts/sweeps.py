"""A sweep on the wire: a base application, axes over its fields, and one table of results."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from shared.contracts.application import MOST_TAGS, Name
from shared.contracts.strict import Strict

MOST_AXES = 5

Path = Annotated[str, Field(pattern=r"^[A-Za-z_]\w*(\.[A-Za-z_]\w*|\[\d+\])*$", max_length=200)]
"""A field of an application, such as `objective.alpha`, `tasks[2].payload_kg` or `robot`."""


class SweepRequest(Strict):
    """Every combination of the axes' values, put into the base, is an application."""

    name: Name
    application: dict[str, Any] = Field(description="the base, as it would be submitted by itself; needs no name")
    axes: dict[Path, Annotated[list[Any], Field(min_length=1)]] = Field(
        min_length=1, max_length=MOST_AXES, description="values by field; the last axis varies fastest"
    )
    tags: list[Name] = Field(default_factory=list, max_length=MOST_TAGS)

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "name": "time against energy",
                    "application": {
                        "objective": {"kind": "weighted"},
                        "tasks": {"grid": {"stroke": [0.2, 0.6, 1.0], "payload_kg": [0, 4]}},
                    },
                    "axes": {"objective.alpha": [0.0, 0.5, 1.0], "robot_changes.gear_ratio": [80, 100]},
                }
            ]
        }
    )


class AcceptedSweep(BaseModel):
    """Answer to a submission."""

    id: str
    applications: int
    url: str


class SweepTotals(BaseModel):
    """One method in one application: sums over the tasks that it solved."""

    tasks: int = Field(description="solved; totals of different counts do not compare")
    objective: float = Field(description="in the point's `unit`")
    weighted_objective: float = Field(description="each task times its weight")
    worst_objective: float = Field(description="the largest of a task")
    time_s: float
    energy_V2s: float
    electrical_energy_J: float


class SweepPointResult(BaseModel):
    """A row of the table."""

    position: int
    values: dict[str, Any] = Field(description="by axis")
    application_id: str
    state: str
    reason: str | None
    objective: str = Field(description="its kind")
    unit: str
    method: str
    tasks: int
    totals: dict[str, SweepTotals] = Field(description="by method; `own`: every task with motors of its own")
    designs_mm: dict[str, list[list[float]]] = Field(description="by method: a row of lengths for each motor")


class SweepStatus(BaseModel):
    """A sweep with its results so far."""

    id: str
    name: str
    state: str
    created_at: str
    tags: list[str]
    axes: dict[str, list[Any]]
    counts: dict[str, int] = Field(description="applications by state")
    dimensions: list[str] = Field(description="columns of the designs")
    points: list[SweepPointResult]


class SweepItem(BaseModel):
    """A sweep in a list."""

    id: str
    name: str
    state: str
    created_at: str
    tags: list[str]
    axes: list[str]
    counts: dict[str, int]


class SweepList(BaseModel):
    """Newest first."""

    items: list[SweepItem]
    next_cursor: str | None
