"""What people get back: status, tasks, designs, motions and comparisons, with units in the names."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, Field

from shared.contracts.application import GridRequest, MethodName, ObjectiveRequest

Source = Literal["own", "two_step", "empirical", "worst_case"]
"""Where a motion comes from: the task's own co-design, or a method's design."""


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
    eta_s: float | None = Field(None, description="estimated time left; null until the first job is done")
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


class ApplicationItem(BaseModel):
    """An application in a list."""

    id: str
    name: str
    state: str
    created_at: str
    finished_at: str | None
    tags: list[str]


class ApplicationList(BaseModel):
    """Newest first."""

    items: list[ApplicationItem]
    next_cursor: str | None


class Certificate(BaseModel):
    """What was checked about a result, apart from the solver."""

    kkt_residual: float | None = Field(description="scaled; recomputed from the program with the multipliers")
    limit_violation: float | None = Field(description="largest violation at the grid points, as a share of the limit")


class MotionResult(BaseModel):
    """What a motion costs and how hard it works the motors; lists are over the joints."""

    objective: float = Field(description="what was minimised: s, V2 s, or the weighted sum")
    final_time_s: float
    energy_V2s: float = Field(description="integral of u'u, the paper's energy")
    electrical_energy_J: float = Field(description="signed")
    copper_loss_J: float
    recovered_energy_J: list[float] = Field(description="what each motor gives back")
    peaks: dict[str, list[float]] = Field(description="largest share of each limit, 1 = at the limit")
    rms: dict[str, list[float]] = Field(description="root mean square share of each limit")
    certificate: Certificate
    design_mm: list[list[float]] = Field(description="one row a motor: L, R_ro, R_so, h_m, h_sy, w_tooth, b_0")
    solver_status: str
    iterations: int
    solve_time_s: float


class TaskResult(BaseModel):
    """A task: its own optimum, and its motion with each method's design."""

    index: int
    name: str
    payload_kg: float
    weight: float
    state: str
    reason: str | None = Field(None, description="why it failed")
    solver_status: str | None = None
    iterations: int | None = None
    solve_time_s: float | None = None
    own: MotionResult | None = None
    methods: dict[str, MotionResult]


class TaskList(BaseModel):
    """Tasks in their order."""

    items: list[TaskResult]
    next_cursor: str | None


class DesignAnswer(BaseModel):
    """The final design, motor by motor."""

    application_id: str
    method: str
    motors: list[dict[str, Any]]
    design_mm: list[list[float]]


class OwnDesign(BaseModel):
    """The design that is best for one task alone."""

    index: int
    name: str
    design_mm: list[list[float]]


class SharedDesign(BaseModel):
    """A design for all tasks."""

    design_mm: list[list[float]]
    task: int | None = Field(None, description="the task whose own design it is")
    tasks: list[int] | None = Field(None, description="tasks in the mean")
    distance: float | None = Field(None, description="Problem 2: sum of squared relative differences to the mean")


class DesignsAnswer(BaseModel):
    """Every design there is."""

    dimensions: list[str]
    tasks: list[OwnDesign]
    mean: SharedDesign | None
    methods: dict[str, SharedDesign]


class MethodTotals(BaseModel):
    """One method over the tasks that every method solved."""

    total_objective: float = Field(description="in the comparison's unit")
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


class ComparisonAnswer(BaseModel):
    """Methods side by side; `own` is each task with its own design, a bound for the others."""

    objective: str
    unit: str
    tasks_compared: list[int]
    task_names: list[str]
    grid: GridRequest | None
    methods: dict[str, MethodTotals]
    regret: dict[str, Regret]
    missing: dict[str, str] = Field(description="methods that have no result, and why")


class Trajectory(BaseModel):
    """A motion on its grid: lists over the points, each with one value a joint."""

    application_id: str
    task: int
    method: str
    time_s: list[float]
    joint_position_rad: list[list[float]]
    joint_speed_rad_s: list[list[float]]
    joint_torque_Nm: list[list[float]]
    current_d_A: list[list[float]]
    current_q_A: list[list[float]]
    voltage_d_V: list[list[float]]
    voltage_q_V: list[list[float]]
    control: str = Field(description="how the voltages run between the points")
    scheme: str
    degree: int
