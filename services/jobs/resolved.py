"""A resolved application: every default filled in, robot and tasks explicit. It is what jobs read."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from pydantic import ConfigDict, Field

from services.codesign.catalogue import Catalogue, CatalogueMotor
from services.codesign.comparison import over_tasks
from services.codesign.freedom import Freedom, FreedomError, FreeGear, TieBreak
from services.codesign.motor_data import DIMENSIONS, MotorData
from services.codesign.problem import FIRST, Accuracy, Objective, Problem, Task, Transcription
from services.codesign.robot import Robot
from services.jobs.design_wire import MILLIMETRE, design_array
from shared.contracts.application import (
    ALL_JOINTS,
    DesignRequest,
    GridRequest,
    Length,
    MethodName,
    MotorRequest,
    ObjectiveRequest,
    ScatterRequest,
    TaskRequest,
    TieBreakRequest,
    TranscriptionRequest,
)
from shared.contracts.strict import Strict

SHARED: MethodName = "shared_optimum"
CATALOGUE: MethodName = "catalogue"


def late_methods(methods: Sequence[MethodName]) -> list[MethodName]:
    """Methods whose design comes after the motions of the others: the shared optimum, and what is snapped from it."""
    return [method for method in methods if method in (SHARED, CATALOGUE)] if SHARED in methods else []


class ResolvedTask(TaskRequest):
    """A task with a name."""

    name: str


class ResolvedApplication(Strict):
    """What an application means, independent of presets, uploads and defaults that may change later."""

    model_config = ConfigDict(strict=False)  # read back from the database

    robot: dict[str, Any]
    objective: ObjectiveRequest
    tasks: list[ResolvedTask]
    grid: GridRequest | None = None
    """Set when the tasks came as a grid (stroke major), for heat maps."""
    motor: MotorRequest
    design: DesignRequest = DesignRequest()
    transcription: TranscriptionRequest
    """Filled in: an accuracy, or a transcription as it is."""
    starts: int = 1
    """Solves of each motion, of which the best is kept (`services.codesign.starts`)."""
    scatter: ScatterRequest | None = None
    """With it, `tasks` are samples: `scatter.samples` in a row of each task that was given."""
    given_tasks: list[str] = Field(default_factory=list)
    """Names of the tasks as given, where `tasks` are samples of them."""
    methods: list[MethodName]
    """The application's method first, then those it is compared with."""
    empirical_task: int | None = None
    worst_case_task: int | None = None

    @property
    def method(self) -> MethodName:
        """The method whose design is the application's."""
        return self.methods[0]

    @property
    def base_methods(self) -> list[MethodName]:
        """Methods whose design comes from the tasks' own designs alone."""
        return [method for method in self.methods if method not in self.late_methods]

    @property
    def late_methods(self) -> list[MethodName]:
        """The others, of which the shared optimum is one."""
        return late_methods(self.methods)

    @property
    def catalogue(self) -> Catalogue | None:
        """Sizes that can be had."""
        asked = self.design.catalogue
        if asked is None:
            return None
        return Catalogue(
            motors=tuple(CatalogueMotor(entry.name, _lengths(entry.dimensions_mm)) for entry in asked.motors),
            steps={str(name): step * MILLIMETRE for name, step in asked.steps_mm.items()},
        )

    def design_task(self, method: MethodName) -> int | None:
        """The task whose own design a method takes; None for methods that use all tasks."""
        return {"empirical": self.empirical_task, "worst_case": self.worst_case_task}.get(method)

    def given_task_of(self, task: int) -> int:
        """The place, among the tasks as given, of the one that a task is a sample of."""
        return task if self.scatter is None else task // self.scatter.samples

    def over_tasks(self, objectives: Mapping[int, float]) -> float:
        """What one design is judged by, from the objectives of some tasks by index; infinite without any."""
        weights = [self.tasks[k].weight for k in objectives]
        share = self.objective.over_tasks.worst_share
        return over_tasks(list(objectives.values()), weights, share) if objectives else math.inf

    def shares_of_tasks(self, objectives: Mapping[int, float], deciding: Mapping[int, float]) -> dict[int, float]:
        """How much what a design is judged by changes with each task's objective.

        `deciding`: shares of the tasks in the worst one's objective, where they are known; else the worst has all.
        """
        deciding = deciding or {max(objectives, key=lambda k: objectives[k]): 1.0}
        worst, total = self.objective.over_tasks.worst_share, sum(self.tasks[k].weight for k in objectives)
        return {k: (1 - worst) * self.tasks[k].weight + worst * total * deciding.get(k, 0.0) for k in objectives}

    def as_request(self, name: str, tags: Sequence[str] = ()) -> dict[str, Any]:
        """A request that is understood as this application again, whatever becomes of presets and uploads."""
        tasks: Any = [task.model_dump(mode="json", exclude_none=True) for task in self.tasks]
        if self.grid is not None:
            tasks = {"grid": self.grid.model_dump(mode="json", exclude_none=True)}
        request = {
            "name": name,
            "robot": self.robot,
            "objective": self.objective.model_dump(mode="json", exclude_none=True),
            "tasks": tasks,
            "motor": self.motor.to_wire(),
            "design": self.design.model_dump(mode="json", exclude_defaults=True) or None,
            "transcription": self.transcription.model_dump(mode="json", exclude_none=True),
            "starts": self.starts,
            "method": self.method,
            "compare": list(self.methods[1:]),
            "empirical_task": self.empirical_task,
            "worst_case_task": self.worst_case_task,
            "tags": list(tags),
        }
        return {key: value for key, value in request.items() if value is not None}

    @cached_property
    def arm(self) -> Robot:
        """The robot, built and checked once; jobs of one application share what was accepted (`spec.py`)."""
        return Robot.from_wire(self.robot)

    def build_motor(self) -> MotorData:
        """The motors' constants, bounds and limits."""
        return MotorData.from_wire(self.motor.to_wire())

    @cached_property
    def freedom(self) -> Freedom:
        """What a design may choose beside lengths."""
        return freedom_of(self.design, self.arm.joints)

    @property
    def accuracy(self) -> Accuracy | None:
        """The accuracy that was asked for; None for a transcription as it is."""
        asked = self.transcription.accuracy
        return None if asked is None else Accuracy(asked.position_rad, asked.speed_rad_s, asked.limit)

    def build_problem(
        self, task_index: int, design: np.ndarray | None = None, gear_ratio: np.ndarray | None = None
    ) -> Problem:
        """The optimal control problem of one task, with `design` of shape (n, 7) [m] fixed when it is given.

        Where an accuracy was asked for, the transcription is the one that is tried first.

        Parameters
        ----------
        gear_ratio
            Shape (n,): those of the design that is given, or where the search for free ones begins; the robot's own,
            or what of the bounds is nearest to them, when None.
        """
        own = self.arm.gear_ratio
        return Problem(
            robot=self.arm.with_gears(self.freedom.admitted(own) if gear_ratio is None else gear_ratio),
            task=_task(self.tasks[task_index]),
            motor=self.build_motor(),
            objective=_objective(self.objective),
            transcription=FIRST if self.accuracy is not None else Transcription(**self.transcription.as_it_is),
            design=design,
            freedom=self.freedom,
            tie_break=_tie_break(self.design.tie_break),
        )


def freedom_of(request: DesignRequest, joints: int) -> Freedom:
    """What a request leaves to the design of an arm.

    Raises
    ------
    FreedomError
        For a joint that is no number, or bounds that are not two.
    """
    ratios = request.gear_ratios
    if ALL_JOINTS in ratios:
        ratios = {str(k + 1): ratios[ALL_JOINTS] for k in range(joints)} | ratios
    gears = [_free_gear(joint, bounds) for joint, bounds in ratios.items() if joint != ALL_JOINTS]
    return Freedom(
        gears=tuple(sorted(gears, key=lambda gear: gear.joint)),
        identical=tuple(tuple(joint - 1 for joint in group) for group in request.identical),
    )


def _tie_break(request: TieBreakRequest | None) -> TieBreak | None:
    if request is None:
        return None
    nearest_to = request.nearest_to_mm
    return TieBreak(request.tolerance, None if nearest_to is None else design_array(nearest_to))


def _lengths(dimensions_mm: Mapping[Length, float]) -> np.ndarray:
    """Shape (7,), m."""
    by_name = {str(name): millimetres for name, millimetres in dimensions_mm.items()}
    lengths: np.ndarray = design_array([[by_name[name] for name in DIMENSIONS]])[0]
    return lengths


def _free_gear(joint: str, bounds: list[float]) -> FreeGear:
    if not (joint.isascii() and joint.isdigit()):
        raise FreedomError("gear_ratios", joint, f"must be a joint's number, from 1, or {ALL_JOINTS}")
    if len(bounds) != 2:
        raise FreedomError(f"gear_ratios.{joint}", bounds, "must be [low, high]")
    return FreeGear(int(joint) - 1, *bounds)


def _task(task: ResolvedTask) -> Task:
    def speeds(values: list[float] | None) -> np.ndarray | None:
        return None if values is None else np.array(values)

    return Task(
        start=np.array(task.start_rad),
        end=np.array(task.end_rad),
        payload=task.payload_kg,
        start_speed=speeds(task.start_speed_rad_s),
        end_speed=speeds(task.end_speed_rad_s),
        duration=task.duration_s,
    )


def _objective(objective: ObjectiveRequest) -> Objective:
    low, high = objective.final_time_bounds_s
    return Objective(
        kind=objective.kind,
        alpha=objective.alpha or 0.0,
        time_reference=objective.time_reference_s,
        effort_reference=objective.energy_reference_V2s,
        final_time_bounds=(low, high),
    )
