"""What is asked: a task, an objective, a transcription, and all of it together as a problem."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from services.codesign.freedom import Freedom, TieBreak
from services.codesign.interval import IntervalLayout
from services.codesign.motor_data import MotorData
from services.codesign.robot import Robot

OBJECTIVES = ("time", "energy", "weighted", "electrical_energy")
FINAL_TIME_BOUNDS = (0.05, 20.0)
"""Default bounds [s] of a free t_f (MODEL section 4)."""


@dataclass(frozen=True)
class Task:
    """T_i = (x_0, x_f, M_p): from one joint state to another with a payload  (Section II-C)."""

    start: np.ndarray  # (n,) rad
    end: np.ndarray  # (n,) rad
    payload: float = 0.0  # kg
    start_speed: np.ndarray | None = None  # (n,) rad/s, at rest when None
    end_speed: np.ndarray | None = None
    duration: float | None = None  # s, for the energy objective

    @property
    def start_velocity(self) -> np.ndarray:
        """Joint speeds at the start, shape (n,), rad/s."""
        return np.zeros_like(self.start) if self.start_speed is None else self.start_speed

    @property
    def end_velocity(self) -> np.ndarray:
        """Joint speeds at the end, shape (n,), rad/s."""
        return np.zeros_like(self.end) if self.end_speed is None else self.end_speed


@dataclass(frozen=True)
class Objective:
    """`time`: t_f; `energy`: integral of u'u over the task's duration; `weighted`: a mix of both with free t_f.

    `electrical_energy`: what the motors draw over the task's duration less what they give back, in J.
    ``(1 - alpha) t_f / time_reference + alpha E / effort_reference`` for `weighted`  (MODEL section 1).
    """

    kind: str = "time"
    alpha: float = 0.0
    time_reference: float | None = None  # s; None: the task's own minimum time (solve.references)
    effort_reference: float | None = None  # V2 s; None: the integral of u'u of that motion
    final_time_bounds: tuple[float, float] = FINAL_TIME_BOUNDS

    def __post_init__(self) -> None:
        if self.kind not in OBJECTIVES:
            raise ValueError(f"objective.kind {self.kind!r}: must be one of {', '.join(OBJECTIVES)}")

    @property
    def has_given_duration(self) -> bool:
        """Whether t_f is the task's duration, and not free."""
        return self.kind in ("energy", "electrical_energy")

    @property
    def is_resolved(self) -> bool:
        """Whether its numbers are all there: a `weighted` one needs both references."""
        return self.kind != "weighted" or None not in (self.time_reference, self.effort_reference)


@dataclass(frozen=True)
class Transcription:
    """How the continuous problem becomes a program. The default is the paper's: Radau, degree 1, 50 intervals."""

    scheme: str = "radau"
    degree: int = 1
    intervals: int = 50
    control: str = "voltage"
    dynamics: str = "inverse"
    widths: tuple[float, ...] | None = None  # share of t_f of each interval, sum 1; equal when None

    def __post_init__(self) -> None:
        if self.widths is not None and len(self.widths) != self.intervals:
            raise ValueError(f"{len(self.widths)} widths for {self.intervals} intervals")

    @property
    def shares(self) -> np.ndarray:
        """Share of t_f that each interval takes, shape (N,)."""
        return np.full(self.intervals, 1 / self.intervals) if self.widths is None else np.array(self.widths)

    def layout(self, joints: int, free_gears: tuple[int, ...] = ()) -> IntervalLayout:
        """The layout of one interval for an arm of `joints` joints, some of them with a free gear ratio."""
        return IntervalLayout(joints, self.scheme, self.degree, self.control, self.dynamics, free_gears)


FIRST = Transcription("radau", 3, 50, "current")
"""What an accuracy is first tried with: keeps the default one at once for the paper's tasks. Degree 2 exceeds limits by
up to 1 percent between points, and 25 intervals cost 1.5 percent of the minimum time: departure 12 (docs/model.md)."""


@dataclass(frozen=True)
class Accuracy:
    """What a replay of the motion has to keep to; the defaults are those of new applications."""

    position: float = 1e-3  # rad, at t_f
    speed: float = 1e-2  # rad/s, at t_f
    limit: float = 1e-3  # share by which a limit may be exceeded, at and between grid points


@dataclass(frozen=True)
class Problem:
    """One task to be solved: Problem 1 with n = 1, or its motion alone when `design` is given."""

    robot: Robot
    task: Task
    motor: MotorData = field(default_factory=MotorData)
    objective: Objective = field(default_factory=Objective)
    transcription: Transcription = field(default_factory=Transcription)
    design: np.ndarray | None = None  # (n, 7) m: fixed motors and the robot's gears, None: free
    freedom: Freedom = field(
        default_factory=Freedom
    )  # of a design that is free; the search begins at the robot's gear ratios
    tie_break: TieBreak | None = None  # of a design that is free; None: whichever the solver comes upon

    def __post_init__(self) -> None:
        joints = list(self.freedom.free_gears)
        if joints and (self.task.start_velocity[joints].any() or self.task.end_velocity[joints].any()):
            raise ValueError("a joint whose gear ratio is free must start and end its tasks at rest")

    @property
    def free_gears(self) -> tuple[int, ...]:
        """Joints whose gear ratio is sought; none with a design that is given."""
        return self.freedom.free_gears if self.design is None else ()

    @property
    def motor_of(self) -> tuple[int, ...]:
        """The motor, 0..m-1, of each joint; with a design that is given every joint has one of its own."""
        return (self.freedom if self.design is None else Freedom()).motor_of(self.robot.joints)

    @property
    def layout(self) -> IntervalLayout:
        """The layout of one interval."""
        return self.transcription.layout(self.robot.joints, self.free_gears)

    @property
    def final_time_bounds(self) -> tuple[float, float]:
        """Bounds of t_f [s]; both are the task's duration for the energy objectives."""
        if not self.objective.has_given_duration:
            return self.objective.final_time_bounds
        if self.task.duration is None:  # Departure 8 (docs/model.md)
            raise ValueError("the energy objective needs task.duration: with t_f free, slower is always better")
        return self.task.duration, self.task.duration
