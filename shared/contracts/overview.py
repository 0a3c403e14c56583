"""An application at a glance: what a page that follows it live needs, small enough to be read again and again."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field

from shared.contracts.application import (
    DesignRequest,
    GridRequest,
    MethodName,
    ObjectiveRequest,
    ScatterRequest,
    TranscriptionRequest,
)


class SolveOutcome(BaseModel):
    """One solve of a task."""

    state: str
    value: float | None = Field(None, description="the objective, in the overview's unit")
    reason: str | None = Field(None, description="why there is no value")


class TaskOverview(BaseModel):
    """A task and what became of its solves."""

    index: int
    name: str
    payload_kg: float
    outcomes: dict[str, SolveOutcome] = Field(description="`own`, and each method whose motions are planned")


class RunningJob(BaseModel):
    """A job that a worker holds."""

    stage: str
    method: str
    task_index: int
    worker: str | None
    for_s: float = Field(description="since it was claimed, by the database's clock")


class Overview(BaseModel):
    """All tasks of an application, without their motions and certificates."""

    application_id: str
    unit: str = Field(description="of every value")
    last_event: int = Field(description="number of the latest event that this includes: follow events after it")
    grid: GridRequest | None
    methods: list[MethodName]
    tasks: list[TaskOverview]
    running: list[RunningJob]


class Resolved(BaseModel):
    """What an application means, every default filled in."""

    application_id: str
    robot: dict[str, Any] = Field(description="in the form that uploads take")
    objective: ObjectiveRequest
    tasks: list[dict[str, Any]]
    grid: GridRequest | None
    scatter: ScatterRequest | None = Field(None, description="with it, `tasks` are samples of `given_tasks`")
    given_tasks: list[str] = Field([], description="names of the tasks as given, where `tasks` are samples of them")
    motor: dict[str, Any] = Field(description="constants, limits and bounds, in the form of a request")
    design: DesignRequest = DesignRequest()
    transcription: TranscriptionRequest
    starts: int = Field(1, description="solves of each motion, of which the best is kept")
    methods: list[MethodName]
    empirical_task: int | None
    worst_case_task: int | None
    request: dict[str, Any] = Field(description="as it was submitted")
