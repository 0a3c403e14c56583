"""Designs, of one task and for all, and the methods that made them side by side, with units in the names."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, Field

from shared.contracts.application import GridRequest
from shared.contracts.motions import Limit


class DesignAnswer(BaseModel):
    """The final design, motor by motor."""

    application_id: str
    method: str
    motors: list[dict[str, Any]]
    design_mm: list[list[float]]
    gear_ratio: list[float] | None = Field(None, description="rotor turns per joint turn, where the ratios were free")


class OwnDesign(BaseModel):
    """The design that is best for one task alone."""

    index: int
    name: str
    design_mm: list[list[float]]
    gear_ratio: list[float] | None = Field(None, description="rotor turns per joint turn, where the ratios were free")


class DecidingTask(BaseModel):
    """A task that keeps the worst task's objective from falling."""

    index: int
    name: str
    share: float = Field(description="of the worst objective's multiplier; all together 1")


class SharedDesign(BaseModel):
    """A design for all tasks."""

    design_mm: list[list[float]]
    gear_ratio: list[float] | None = Field(None, description="rotor turns per joint turn, where the ratios were free")
    task: int | None = Field(None, description="the task whose own design it is")
    tasks: list[int] | None = Field(None, description="tasks in the mean")
    start: str | None = Field(None, description="shared_optimum: the method whose design it started from")
    convergence: list[list[float]] | None = Field(
        None, description="shared_optimum: [iteration, what the design is judged by] along the solve"
    )
    stopped: bool | None = Field(
        None, description="shared_optimum: whether the search was asked to end; the design is the best found by then"
    )
    solver_status: str | None = Field(None, description="of the joint program, or of Problem 2")
    iterations: int | None = Field(None, description="shared_optimum: of the joint program")
    solve_time_s: float | None = Field(None, description="shared_optimum: of the joint program")
    kkt_residual: float | None = Field(None, description="shared_optimum: of the joint program, scaled")
    constraint_violation: float | None = Field(None, description="shared_optimum: of the joint program, scaled")
    deciding_tasks: list[DecidingTask] | None = Field(
        None, description="shared_optimum over the worst task: the tasks that decide, from their multipliers"
    )
    limits: list[Limit] | None = Field(
        None, description="shared_optimum: the motors' limits that hold back what the design is judged by"
    )
    distance: float | None = Field(
        None, description="sum of squared relative differences: of Problem 2 to the mean, of `catalogue` to its source"
    )
    source: str | None = Field(None, description="catalogue: the method whose design was moved to sizes that exist")
    entries: list[str] | None = Field(None, description="catalogue: each joint's motor, where motors have names")


class DesignsAnswer(BaseModel):
    """Every design there is."""

    dimensions: list[str]
    tasks: list[OwnDesign]
    mean: SharedDesign | None
    methods: dict[str, SharedDesign]


class MethodTotals(BaseModel):
    """One method over the tasks that every method solved."""

    total_objective: float = Field(description="in the comparison's unit, every task once")
    weighted_objective: float = Field(description="sum of weight x objective: what a design is for, unless `worst`")
    worst_objective: float = Field(description="of the worst task")
    worst_task: int | None = Field(description="its index; null when no task is compared")
    total_time_s: float
    total_energy_V2s: float
    total_electrical_energy_J: float
    total_copper_loss_J: float
    per_task: list[dict[str, float]] = Field(description="in the order of `tasks_compared`")
    design_mm: list[list[float]] | None


class Regret(BaseModel):
    """(value - the task's own optimum) / own optimum, of the objective."""

    total: float | None
    per_task: list[float | None] = Field(description="in the order of `tasks_compared`")


class LimitCost(BaseModel):
    """What relaxing one limit a little would bring, over the tasks compared.

    For `own` and `shared_optimum` motors and motions adapt; for the other methods the motions alone.
    """

    name: str = Field(description="as in a request: current_limit_A, bounds_mm.L.high, ...")
    value: float | None = Field(description="null where the tasks' values differ")
    unit: str = Field(description="of the limit")
    relax: Literal["raise", "lower"]
    gain_per_unit: float = Field(description="what the design is judged by falls by this per unit of the limit")
    gain_per_percent: float = Field(description="and this for one percent of the limit, or of a joint's range")
    tasks: list[int] = Field(description="tasks whose motion it holds back; for `own`, or whose motors")
    of_the_design: bool = Field(description="it holds back the motors that the tasks share")


class Spread(BaseModel):
    """One method's objectives over the samples of one task."""

    mean: float
    standard_deviation: float = Field(description="of the samples")
    largest: float


class ScatteredTask(BaseModel):
    """A task as it was given, over its samples."""

    name: str
    samples: int = Field(description="those that every method solved")
    methods: dict[str, Spread]


class ComparisonAnswer(BaseModel):
    """Methods side by side; `own` is each task with its own design, a bound for the others."""

    objective: str
    unit: str
    tasks_compared: list[int]
    task_names: list[str]
    task_weights: list[float] = Field(description="how often each task compared occurs")
    grid: GridRequest | None
    methods: dict[str, MethodTotals]
    regret: dict[str, Regret]
    judged: dict[str, float] = Field(
        {}, description="by method, what a design is for: `objective.over_tasks` of the tasks compared, with weights"
    )
    unsolved: dict[str, list[int]] = Field({}, description="by method, the tasks that it has no motion for")
    scattered: list[ScatteredTask] = Field([], description="with scatter: each task given, over its samples")
    limits: dict[str, list[LimitCost]] = Field(
        {}, description="by method, the limits that bind, the most rewarding first"
    )
    missing: dict[str, str] = Field(description="methods that have no result, and why")
