"""Motions: what they cost, how they run over time, and how their solves went, with units in the names."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, Field

from shared.contracts.certificates import Certificate

Source = Literal["own", "two_step", "shared_optimum", "empirical", "worst_case", "catalogue"]
"""Where a motion comes from: the task's own co-design, or a method's design."""


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

    @property
    def spread(self) -> float:
        """How far the worst of the optima lies above the best, as a share of the best."""
        best, worst = self.ends[0].objective, self.ends[-1].objective
        return 0.0 if worst == best else (worst - best) / abs(best)


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
    solve_time_s: float = Field(description="from the guess to the answer; the certificate comes on top")
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
