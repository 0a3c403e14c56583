"""What people get back: status, tasks, designs, motions and comparisons, with units in the names."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, Field

from shared.contracts.application import GridRequest, MethodName, ObjectiveRequest

Source = Literal["own", "two_step", "shared_optimum", "empirical", "worst_case", "catalogue"]
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


class LimitCheck(BaseModel):
    """How far a kind of limit is exceeded, as a share of it (of the range for joints); 0 when it is kept."""

    at_points: float | None = Field(description="by the motion at its grid points")
    between_points: float | None = Field(description="by the replay, densely; null when it broke off")


class ElectricalBalance(BaseModel):
    """Electrical input = copper loss + change of field energy + shaft work, on the replay, all motors together."""

    input_J: float
    copper_J: float
    field_change_J: float
    shaft_J: float
    residual_J: float
    turned_over_J: float = Field(description="sum of the sizes of the terms")
    closed: bool = Field(description="residual within 1e-6 of what was turned over")


class MechanicalBalance(BaseModel):
    """Shaft work = change of kinetic and potential energy, rotors included, + friction at the joints, on the replay."""

    shaft_J: float
    kinetic_and_potential_change_J: float
    friction_J: float = Field(0.0, description="lost at the joints")
    residual_J: float
    turned_over_J: float = Field(description="sum of the sizes of the terms")
    closed: bool = Field(description="residual within 1e-6 of what was turned over")


class EnergyBalance(BaseModel):
    """Both balances."""

    electrical: ElectricalBalance
    mechanical: MechanicalBalance


class Tolerance(BaseModel):
    """What a certificate is judged by."""

    position_rad: float
    speed_rad_s: float
    limit: float = Field(description="share by which a limit may be exceeded")


class Refinement(BaseModel):
    """One solve on the way to the accuracy that was asked for, and what its replay found."""

    degree: int
    intervals: int
    replay_position_rad: float | None
    replay_speed_rad_s: float | None
    limit_violation: float | None


class Certificate(BaseModel):
    """What was found when a motion's voltages were replayed by an accurate integrator, and how nearly it is optimal.

    Everything is computed apart from the solver and the transcription. Figures of a failed solve are null.
    """

    replay_position_rad: float | None = Field(None, description="to the task's end at t_f, largest over the joints")
    replay_speed_rad_s: float | None = Field(
        None, description="to the task's end speed at t_f, largest over the joints"
    )
    path_position_rad: float | None = Field(None, description="between replay and motion, largest at the grid points")
    path_speed_rad_s: float | None = Field(None, description="between replay and motion, largest at the grid points")
    limit_violation: float | None = Field(
        None, description="largest of `limits`: share of the limit, 0 when all are kept"
    )
    limits: dict[str, LimitCheck] | None = Field(None, description="joint_range, rotor_speed, current, voltage")
    kkt_residual: float | None = Field(description="scaled; recomputed from the program with the multipliers")
    constraint_violation: float | None = Field(None, description="of the program at the solution, scaled")
    energy_balance: EnergyBalance | None = None
    tolerance: Tolerance | None = None
    within_tolerance: bool | None = Field(None, description="whether replay and limits meet `tolerance`")
    as_requested: bool | None = Field(
        None, description="the transcription was asked for as it is, so a missed tolerance is no failure"
    )
    scheme: str | None = None
    degree: int | None = None
    intervals: int | None = None
    control: str | None = None
    refinements: list[Refinement] | None = Field(None, description="solves on the way to the accuracy, the last too")
    input_hash: str | None = Field(None, description="SHA-256 of robot, task, motor, objective, transcription, design")


class Limit(BaseModel):
    """A limit that holds a motion back, and by how much: a multiplier in the units of the limit."""

    name: str = Field(description="as in a request: current_limit_A, bounds_mm.L.high, ...")
    value: float
    unit: str
    slope: float = Field(description="change of the objective per unit of the limit, for a small change")
    span: float = Field(description="what a share of the limit is taken of: its size, or a joint's range")


class StartRun(BaseModel):
    """What became of one start. The first is the usual one, with all its attempts."""

    solver_status: str
    objective: float | None = Field(description="null when it failed")
    iterations: int
    solve_time_s: float


class StartsEnd(BaseModel):
    """An optimum, and how many starts came within 0.1 percent of it."""

    objective: float
    starts: int


class Starts(BaseModel):
    """Several starts of one motion, in the objective's unit, before any refinement of the grid."""

    solved: int
    ends: list[StartsEnd] = Field(description="local optima, best first: the spread, and how many starts found each")
    runs: list[StartRun]


class MotionResult(BaseModel):
    """What a motion costs and how hard it works the motors; lists are over the joints."""

    objective: float = Field(description="what was minimised: s, V2 s, or the weighted sum")
    final_time_s: float
    energy_V2s: float = Field(description="integral of u'u, the paper's energy")
    electrical_energy_J: float = Field(description="signed; this and the next two on the replay")
    copper_loss_J: float
    recovered_energy_J: list[float] = Field(description="what each motor gives back")
    peaks: dict[str, list[float]] = Field(description="largest share of each limit, 1 = at the limit; on the replay")
    rms: dict[str, list[float]] = Field(description="root mean square share of each limit; on the replay")
    peaks_at_points: dict[str, list[float]] | None = Field(
        None, description="of the trajectory's grid points alone: a largest value there over this is its limit"
    )
    certificate: Certificate
    limits: list[Limit] = Field([], description="those that hold the objective back; with free motors, theirs too")
    design_mm: list[list[float]] = Field(description="one row a motor: L, R_ro, R_so, h_m, h_sy, w_tooth, b_0")
    gear_ratio: list[float] | None = Field(None, description="rotor turns per joint turn, where the ratios were free")
    solver_status: str
    iterations: int = Field(description="of all attempts, starts and refinements")
    solve_time_s: float
    starts: Starts | None = Field(None, description="with several `starts`: what they found")


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


class VoltageControl(BaseModel):
    """How the voltages run, at every time: a polynomial on each interval.

    For t in interval w, with s = (t - breaks_s[w]) / (breaks_s[w + 1] - breaks_s[w]):
    u = sum over k of coefficients[w][k] * s^k, with the coefficients in V, one a joint.
    """

    kind: Literal["piecewise_constant", "piecewise_polynomial"]
    description: str = Field(description="for people")
    breaks_s: list[float] = Field(description="ends of the intervals, first 0, last the final time")
    voltage_d_V: list[list[list[float]]] = Field(description="coefficients [interval][power][joint]")
    voltage_q_V: list[list[list[float]]] = Field(description="coefficients [interval][power][joint]")


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
    control: VoltageControl = Field(description="how the voltages run between the points")
    design_mm: list[list[float]] = Field(description="the motors of this motion, one row each")
    gear_ratio: list[float] | None = Field(None, description="rotor turns per joint turn, where the ratios were free")
    scheme: str
    degree: int


class SolverIteration(BaseModel):
    """One iteration of the solver."""

    attempt: int = Field(description="0, 1, ... along the ladder of attempts")
    iteration: int
    objective: float = Field(description="the program's, scaled")


class SolverLog(BaseModel):
    """How a solve went: its attempts, and its last iterations."""

    application_id: str
    task: int
    method: str
    solver_status: str | None
    reason: str | None
    attempts: list[dict[str, Any]]
    iterations: list[SolverIteration]


class SolverPoint(BaseModel):
    """Where the solver ended, in the program's scaled units, with the multipliers: enough to recompute `kkt_residual`.

    Signs are CasADi's: grad f + J' lam_g + lam_x = 0. Variables: design, t_f, then the intervals, each as
    `services.codesign.interval.IntervalLayout` says.
    """

    application_id: str
    task: int
    method: str
    scheme: str
    degree: int
    intervals: int
    control: str
    widths: list[float] = Field(description="share of t_f of each interval")
    x: list[float]
    lam_x: list[float] = Field(description="multipliers of the bounds")
    lam_g: list[float] = Field(description="multipliers of the constraints")
