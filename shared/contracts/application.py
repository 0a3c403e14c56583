"""What people submit: an application, as YAML or JSON. Every quantity carries its unit in its name.

Here a request is checked by itself. What needs the robot (number of joints, joint ranges) is checked in
`services.jobs.resolve`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import BeforeValidator, ConfigDict, Discriminator, Field, Tag, model_validator

from shared.contracts.strict import Strict

LONGEST_NAME = 200
Name = Annotated[str, Field(min_length=1, max_length=LONGEST_NAME)]
MOST_TAGS = 20
MOST_INTERVALS = 400
MOST_JOINTS = 20
MOST_STARTS = 16


class OverTasksRequest(Strict):
    """How the tasks' objectives become one figure for a design that all of them share.

    sum: the weighted sum; worst: the largest of them, the worst task's; mix: a share of each, in units of the sum.
    """

    kind: Literal["sum", "worst", "mix"] = "sum"
    share: float | None = Field(None, gt=0, lt=1, description="of the worst task, `mix` only: 0 sum .. 1 worst")

    @property
    def worst_share(self) -> float:
        """How much the worst task counts: 0 the sum, 1 the worst alone."""
        return {"sum": 0.0, "worst": 1.0, "mix": self.share or 0.0}[self.kind]


class ObjectiveRequest(Strict):
    """What is minimised.

    time: t_f; energy: the integral of u'u over a given duration; weighted: a mix of both with t_f free;
    electrical_energy: the energy drawn less the energy given back, in J, over a given duration.
    """

    kind: Literal["time", "energy", "weighted", "electrical_energy"] = "time"
    alpha: float | None = Field(None, ge=0, le=1, description="weight of energy, `weighted` only: 0 time .. 1 energy")
    time_reference_s: float | None = Field(None, gt=0, description="`weighted`; default: the task's minimum time")
    energy_reference_V2s: float | None = Field(None, gt=0, description="`weighted`; default: of that motion")
    final_time_bounds_s: list[float] = Field([0.05, 20.0], min_length=2, max_length=2)
    over_tasks: OverTasksRequest = Field(OverTasksRequest(), description="`shared_optimum`: what one design is for")


class TaskRequest(Strict):
    """From one joint state to another with a payload."""

    name: Name | None = None
    start_rad: list[float] = Field(min_length=1, max_length=MOST_JOINTS)
    end_rad: list[float] = Field(min_length=1, max_length=MOST_JOINTS)
    start_speed_rad_s: list[float] | None = Field(None, description="at rest when left out")
    end_speed_rad_s: list[float] | None = Field(None, description="at rest when left out")
    payload_kg: float = Field(0.0, ge=0)
    duration_s: float | None = Field(None, gt=0, le=1000, description="needed for the energy objectives")
    weight: float = Field(1.0, gt=0, description="how often the task occurs")


class GridRequest(Strict):
    """The paper's task set: from stroke * (1, ..., 1) rad to 0, for every stroke and payload."""

    stroke: list[float] = Field(min_length=1)
    payload_kg: list[Annotated[float, Field(ge=0)]] = Field(min_length=1)
    duration_s: float | None = Field(None, gt=0, le=1000)


class TaskSetRequest(Strict):
    """Tasks given as a grid."""

    grid: GridRequest


class ScatterRequest(Strict):
    """Every task becomes samples with random payloads and poses; a design that they share is robust over them.

    The samples of a task share its weight, so what a design is judged by is its expected value. The same seed gives
    the same samples; what leaves the robot's joint ranges, or is below no payload, stays at the limit.
    """

    distribution: Literal["uniform", "normal"] = Field(
        "uniform", description="uniform: up to so much to either side; normal: with this standard deviation"
    )
    payload_kg: float = Field(0.0, ge=0, description="around each task's payload")
    position_rad: float = Field(0.0, ge=0, description="around each joint's position, at the start and at the end")
    samples: int = Field(ge=1, le=1000, description="of each task")
    seed: int = Field(0, ge=0, lt=2**32)


Factor = Annotated[float, Field(gt=0, le=100)]


def _one_or_each(value: Any) -> Any:
    """A single number stands for all joints."""
    return [value] if isinstance(value, int | float) and not isinstance(value, bool) else value


class RobotChangesRequest(Strict):
    """What differs from the robot that is named; so a preset can be varied, and a sweep run over it."""

    gear_ratio: Annotated[list[float] | None, BeforeValidator(_one_or_each)] = Field(
        None,
        min_length=1,
        max_length=MOST_JOINTS,
        description="rotor turns per joint turn: one number for all joints, or one each; < 0 where it reverses",
    )
    link_mass_scale: Annotated[list[Factor] | None, BeforeValidator(_one_or_each)] = Field(
        None,
        min_length=1,
        max_length=MOST_JOINTS,
        description="factor on the links' masses and, with them, inertias: one number for all links, or one each",
    )
    link_length_scale: float | None = Field(
        None, ge=0.1, le=10, description="factor on every distance of the arm; links keep their shape and their mass"
    )


ALL_JOINTS = "all"
"""In place of a joint's number."""


def _keys_as_text(value: Any) -> Any:
    """Numbers of joints are keys: in YAML numbers, in JSON text."""
    return {str(key): entry for key, entry in value.items()} if isinstance(value, dict) else value


class TieBreakRequest(Strict):
    """Which of the designs that are as good as a task's own optimum, but for a tolerance, is the task's own.

    Many tasks leave some lengths free, and the mean of designs then averages what a solver came upon.
    """

    by: Literal["mass", "nearest"] = Field(
        "mass", description="the lightest motors, or those nearest to a given design"
    )
    tolerance: float = Field(1e-4, ge=1e-6, le=0.1, description="share of the objective that may be given up")
    nearest_to_mm: list[list[float]] | None = Field(
        None, description="`nearest`: a row of L, R_ro, R_so, h_m, h_sy, w_tooth, b_0 for each joint"
    )


Length = Literal["L", "R_ro", "R_so", "h_m", "h_sy", "w_tooth", "b_0"]
Millimetres = Annotated[float, Field(gt=0)]


class CatalogueMotorRequest(Strict):
    """A motor that can be had as it is."""

    name: Name
    dimensions_mm: dict[Length, Millimetres]

    @model_validator(mode="after")
    def _all_lengths(self) -> Self:
        if missing := sorted(set(get_args(Length)) - set(self.dimensions_mm)):
            raise ValueError(f"dimensions_mm must have all seven lengths; missing: {', '.join(missing)}")
        return self


class CatalogueRequest(Strict):
    """Sizes that can be had: motors as they are, or steps in which lengths come."""

    motors: list[CatalogueMotorRequest] = Field(default_factory=list, max_length=1000)
    steps_mm: dict[Length, Millimetres] = Field(
        default_factory=dict, description="in place of motors: lengths come in multiples of these; others as they are"
    )

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        if bool(self.motors) == bool(self.steps_mm):
            raise ValueError("must have motors, or steps_mm: one of them")
        return self


class DesignRequest(Strict):
    """What a design may choose beside the motors' lengths, and which joints must have the same motor."""

    gear_ratios: Annotated[dict[str, list[float]], BeforeValidator(_keys_as_text)] = Field(
        default_factory=dict,
        description="by joint, 1 ... n, or `all`: [low, high] of a gear ratio that is free; its sign is the robot's",
    )
    identical: list[list[int]] = Field(
        default_factory=list,
        max_length=MOST_JOINTS,
        description="groups of joints, 1 ... n, whose motors have the same dimensions: one part to keep in stock",
    )
    catalogue: CatalogueRequest | None = Field(
        None, description="with it, the method `catalogue` is compared: the design moved to sizes that can be had"
    )
    tie_break: TieBreakRequest | None = Field(None, description="left out: whichever design the solver comes upon")


class MotorRequest(Strict):
    """Constants, bounds and limits of the motors; what is left out has the paper's value."""

    pole_pairs: int | None = Field(None, ge=1)
    slots: int | None = Field(None, ge=3)
    phases: int | None = Field(None, ge=3, le=3)
    turns_per_tooth: float | None = Field(None, gt=0)
    parallel_coils: int | None = Field(None, ge=1)
    tooth_tip_height_mm: float | None = Field(None, gt=0)
    air_gap_mm: float | None = Field(None, gt=0)
    magnet_arc_rad: float | None = Field(None, gt=0, le=3.141592653589793)
    remanent_flux_density_T: float | None = Field(None, gt=0)
    recoil_permeability: float | None = Field(None, ge=1)
    filling_factor: float | None = Field(None, gt=0, le=1)
    flux_density_limit_T: float | None = Field(None, gt=0)
    wire_diameter_min_mm: float | None = Field(None, gt=0)
    mass_limit_kg: float | None = Field(None, gt=0)
    slot_height_min_mm: float | None = Field(None, gt=0)
    iron_density_kg_m3: float | None = Field(None, gt=0)
    copper_density_kg_m3: float | None = Field(None, gt=0)
    copper_resistivity_ohm_m: float | None = Field(None, gt=0)
    current_limit_A: float | None = Field(None, gt=0)
    voltage_limit_V: float | None = Field(None, gt=0)
    bounds_mm: dict[Length, list[float]] = Field(
        default_factory=dict, description="[low, high] for any of the seven lengths"
    )

    def to_wire(self) -> dict[str, Any]:
        """Only what was given."""
        given = self.model_dump(exclude_none=True)
        return {key: value for key, value in given.items() if value != {}}


class AccuracyRequest(Strict):
    """What a replay of each motion has to keep to; degree and grid are chosen so that it does."""

    position_rad: float = Field(1e-3, ge=1e-8, le=1, description="replay to the task's end at t_f, largest joint")
    speed_rad_s: float = Field(1e-2, ge=1e-7, le=10, description="replay to the task's end speed at t_f, largest joint")
    limit: float = Field(1e-3, ge=1e-6, le=1, description="share by which a limit may be exceeded between points")


class TranscriptionRequest(Strict):
    """How the continuous problem becomes a program: an accuracy to keep, a preset, or a transcription as it is.

    Left out, the accuracy of `AccuracyRequest`. Of a transcription that is given in part, the rest is the paper's.
    """

    accuracy: AccuracyRequest | None = Field(None, description="degree and grid are chosen and refined")
    preset: Literal["paper"] | None = Field(None, description="paper: radau, degree 1, 50 intervals, voltage")
    scheme: Literal["radau", "legendre"] | None = None
    degree: int | None = Field(None, ge=1, le=5)
    intervals: int | None = Field(None, ge=2, le=MOST_INTERVALS)
    control: Literal["voltage", "current"] | None = Field(
        None,
        description="voltage: constant on each interval (the paper); current: linear, with the voltages that follow",
    )

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        given = [self.accuracy is not None, self.preset is not None, bool(self.as_it_is)]
        if sum(given) > 1:
            raise ValueError("must be an accuracy, a preset, or a scheme with its degree, intervals and control: one")
        return self

    @property
    def as_it_is(self) -> dict[str, Any]:
        """The fields of a transcription given as it is."""
        given = {"scheme": self.scheme, "degree": self.degree, "intervals": self.intervals, "control": self.control}
        return {name: value for name, value in given.items() if value is not None}

    def filled_in(self) -> TranscriptionRequest:
        """With every default: either `accuracy` alone, or scheme, degree, intervals and control."""
        if self.accuracy is not None:
            return self
        if self.preset is None and not self.as_it_is:
            return TranscriptionRequest(accuracy=AccuracyRequest())
        return TranscriptionRequest(**(PAPER | self.as_it_is))


PAPER: dict[str, Any] = {"scheme": "radau", "degree": 1, "intervals": 50, "control": "voltage"}
"""The paper's transcription: implicit Euler on 50 intervals, voltages constant on each."""


def _task_form(value: Any) -> str | None:
    """Which of the two forms a person meant, so that only its errors are shown."""
    if isinstance(value, dict | TaskSetRequest):
        return "task grid"
    return "task list" if isinstance(value, list) else None


def _robot_form(value: Any) -> str | None:
    if isinstance(value, dict):
        return "inline robot"
    return "robot name" if isinstance(value, str) else None


def _choice_form(value: Any) -> str | None:
    if isinstance(value, str):
        return "task name"
    return "task index" if isinstance(value, int) and not isinstance(value, bool) else None


def _one_of(choose: Callable[[Any], str | None], expected: str) -> Discriminator:
    return Discriminator(choose, custom_error_type="wrong_form", custom_error_message=f"must be {expected}")


UNION_TAGS = frozenset({"task grid", "task list", "inline robot", "robot name", "task name", "task index"})
"""Parts of error locations that are not fields."""

Tasks = Annotated[
    Annotated[TaskSetRequest, Tag("task grid")] | Annotated[list[TaskRequest], Tag("task list")],
    _one_of(_task_form, "a list of tasks, or {grid: ...}"),
]
RobotChoice = Annotated[
    Annotated[str, Tag("robot name")] | Annotated[dict[str, Any], Tag("inline robot")],
    _one_of(_robot_form, "a preset's name, the id of an uploaded robot, or a robot"),
]
TaskChoice = Annotated[
    Annotated[int, Tag("task index")] | Annotated[Name, Tag("task name")],
    _one_of(_choice_form, "a task's index or name"),
]
MethodName = Literal["two_step", "shared_optimum", "empirical", "worst_case", "catalogue"]


class ApplicationRequest(Strict):
    """An application: tasks for an arm, and what to minimise."""

    name: Name
    robot: RobotChoice = Field("ur5", description="a preset, the id of an uploaded robot, or a robot inline")
    robot_changes: RobotChangesRequest = RobotChangesRequest()
    objective: ObjectiveRequest = ObjectiveRequest()
    tasks: Tasks
    scatter: ScatterRequest | None = Field(None, description="tasks as random samples, for a robust design")
    motor: MotorRequest = MotorRequest()
    design: DesignRequest = Field(DesignRequest(), description="freedom beyond the paper's: gears; motors alike")
    transcription: TranscriptionRequest = TranscriptionRequest()
    starts: int = Field(1, ge=1, le=MOST_STARTS, description="solves of each motion; the best of its optima is kept")
    method: MethodName = "two_step"
    compare: list[MethodName] = Field(default_factory=list)
    empirical_task: TaskChoice | None = None
    worst_case_task: TaskChoice | None = None
    tags: list[Name] = Field(default_factory=list, max_length=MOST_TAGS)

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "name": "pick-and-place",
                    "robot": "ur5",
                    "objective": {"kind": "time"},
                    "tasks": {"grid": {"stroke": [0.2, 0.4, 0.6, 0.8, 1.0], "payload_kg": [0, 1, 2, 3, 4]}},
                    "compare": ["empirical", "worst_case"],
                }
            ]
        }
    )

    @property
    def methods(self) -> list[MethodName]:
        """The method, then those it is compared with, each once."""
        return list(dict.fromkeys([self.method, *self.compare]))
