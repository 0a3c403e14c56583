"""Where applications stand: their states, stages, counts and times, with units in the names."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field

from shared.contracts.application import GridRequest, MethodName, ObjectiveRequest


class Accepted(BaseModel):
    """Answer to a submission."""

    id: str
    state: str
    url: str


class StageProgress(BaseModel):
    """How far a stage is. `total` is what is planned when nothing fails, until the stage begins."""

    name: str
    total: int
    queued: int = 0
    running: int = 0
    succeeded: int = 0
    failed: int = 0
    dead: int = 0
    cancelled: int = 0


class LatestResult(BaseModel):
    """One result for progress displays."""

    task: str
    task_index: int
    stage: str
    method: str
    value: float
    unit: str


class Progress(BaseModel):
    """Stages, counts and time left."""

    stages: list[StageProgress]
    done: int
    total: int
    eta_s: float | None = Field(None, description="estimated time left; null until enough jobs are done")
    compiling: bool = Field(False, description="a worker compiles derivatives, once for its machine")
    last: LatestResult | None = None
    best: LatestResult | None = None


class ExcludedTask(BaseModel):
    """A task without which the application went on."""

    index: int
    name: str
    reason: str | None


class Timings(BaseModel):
    """Sums over the jobs."""

    solver_time_s: float = Field(description="inside the solver")
    worker_time_s: float = Field(description="from claim to finish")
    wall_time_s: float | None = Field(description="first claim to last finish")


class ApplicationStatus(BaseModel):
    """An application as it stands."""

    id: str
    name: str
    state: str
    reason: str | None
    cancel_requested: bool
    search: Literal["running", "stopping"] | None = Field(
        None, description="for a shared design, while it runs or waits; `stopping` once it was asked to end"
    )
    progress: Progress
    objective: ObjectiveRequest
    method: MethodName
    methods: list[MethodName]
    robot: str
    tasks: int
    grid: GridRequest | None
    excluded_tasks: list[ExcludedTask]
    timings: Timings
    created_at: str
    started_at: str | None
    finished_at: str | None
    tags: list[str]
    versions: dict[str, str]


class TotalResult(BaseModel):
    """Sum of the objective over the tasks that a method solved."""

    method: str = Field(description="`own` until the application's method has motions")
    tasks: int
    value: float
    unit: str


class ApplicationItem(BaseModel):
    """An application in a list."""

    id: str
    name: str
    state: str
    created_at: str
    finished_at: str | None
    tags: list[str]
    objective: str
    method: str
    tasks: int
    done: int = Field(description="jobs that have ended")
    total: int = Field(description="jobs that there are, or will be when nothing fails")
    best: TotalResult | None = None


class ApplicationList(BaseModel):
    """Newest first."""

    items: list[ApplicationItem]
    next_cursor: str | None
