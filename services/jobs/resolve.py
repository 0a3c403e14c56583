"""From a request to a resolved application, or a refusal that names field, value and limit."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from services.codesign.feasible_motor import motor_obstacle
from services.codesign.freedom import FreedomError
from services.codesign.motor_data import DIMENSIONS, MotorData, MotorDataError
from services.codesign.robot import Robot, preset_names, preset_wire
from services.codesign.robot_scaling import scaled_arm
from services.jobs.inline_robot import inline_robot, read_robot
from services.jobs.resolved import CATALOGUE, SHARED, ResolvedApplication, ResolvedTask, freedom_of
from services.jobs.scatter import samples_of
from shared.contracts.application import (
    ApplicationRequest,
    DesignRequest,
    GridRequest,
    MethodName,
    MotorRequest,
    ObjectiveRequest,
    RobotChangesRequest,
    ScatterRequest,
    TaskRequest,
    TieBreakRequest,
)
from shared.contracts.errors import FieldError, InvalidInputError

RobotLookup = Callable[[str], Mapping[str, Any] | None]
"""Finds an uploaded robot by id; None when there is none."""

_NUMERICS = threading.Lock()
"""CasADi's objects and IPOPT are not safe across threads, and the API answers requests on several."""

LONGEST_TIME_S = 1000.0
"""Largest upper bound of a free t_f."""

_RESOLVED_TASKS = TypeAdapter(list[ResolvedTask])

Range = tuple[list[float], list[float], str]
"""Lowest and highest value of each joint, and their unit."""

Located = tuple[str, ResolvedTask]
"""A task and the field of the request that it came from."""


def resolve(request: ApplicationRequest, find_robot: RobotLookup, max_tasks: int) -> ResolvedApplication:
    """Fill in defaults and check everything that needs the robot.

    Raises
    ------
    InvalidInputError
        With every error found.
    """
    wire, robot = _changed(*_robot(request.robot, find_robot), request.robot_changes)
    motor = _motor(request.motor)
    located = list(_tasks(request, robot, max_tasks))
    errors = list(_objective_errors(request.objective))
    ranges = _ranges(robot)
    if not _all_within([task for _, task in located], ranges):
        errors += [error for field, task in located for error in _task_errors(field, task, ranges)]
    errors += _duplicate_names(located)
    errors += _freedom_errors(request.design, located, robot)
    errors += _tie_break_errors(request.design.tie_break, robot)
    if CATALOGUE in request.methods and request.design.catalogue is None:
        errors.append(FieldError("design.catalogue", None, "method catalogue needs motors or steps to choose from"))
    given = [task.name for _, task in located]
    if request.scatter is not None and not errors:
        located = list(_scattered(located, request.scatter, robot))
    if request.objective.kind in ("energy", "electrical_energy"):
        errors += _durations(request, located)
    if not errors:
        errors += _motor_feasible(motor)
    tasks = [task for _, task in located]
    grid = None if isinstance(request.tasks, list) else request.tasks.grid
    chosen, problems = _chosen_tasks(request, tasks)
    if errors or problems:
        raise InvalidInputError([*errors, *problems])
    return ResolvedApplication(
        robot=wire,
        objective=request.objective,
        tasks=tasks,
        grid=grid if request.scatter is None else None,
        scatter=request.scatter,
        given_tasks=[] if request.scatter is None else given,
        motor=request.motor,
        design=request.design,
        transcription=request.transcription.filled_in(),
        starts=request.starts,
        methods=_methods(request),
        empirical_task=chosen["empirical"],
        worst_case_task=chosen["worst_case"],
    )


def _robot(given: str | dict[str, Any], find_robot: RobotLookup) -> tuple[dict[str, Any], Robot]:
    if isinstance(given, dict):
        wire: Mapping[str, Any] | None = inline_robot(given, "robot")
    elif given in _presets():
        return _presets()[given]
    else:
        wire = find_robot(given)
    if wire is None:
        known = ", ".join(_presets())
        raise InvalidInputError(
            [FieldError("robot", given, f"unknown robot; presets are {known}; others need an upload")]
        )
    return dict(wire), read_robot(wire, "robot")


@cache
def _presets() -> dict[str, tuple[dict[str, Any], Robot]]:
    """Of the package: nobody changes them."""
    wires = {name: preset_wire(name) for name in preset_names()}
    return {name: (wire, read_robot(wire, "robot")) for name, wire in wires.items()}


def _changed(wire: dict[str, Any], robot: Robot, changes: RobotChangesRequest) -> tuple[dict[str, Any], Robot]:
    """With other gears and links; the joints' speed limits follow from the rotors' (`Robot.joint_speed_limit`)."""
    changed = wire
    if (ratios := _each(changes.gear_ratio, "gear_ratio", robot.joints)) is not None:
        if 0 in ratios:
            raise InvalidInputError([FieldError("robot_changes.gear_ratio", str(changes.gear_ratio), "must not be 0")])
        changed = changed | {"gear_ratio": ratios}
    masses = _each(changes.link_mass_scale, "link_mass_scale", robot.joints)
    if masses is not None or changes.link_length_scale is not None:
        changed = scaled_arm(changed, changes.link_length_scale or 1.0, masses or [1.0] * robot.joints)
    return changed, robot if changed is wire else read_robot(changed, "robot")


def _each(given: list[float] | None, name: str, joints: int) -> list[float] | None:
    """One value for each joint, where one is given for all."""
    if given is None or len(given) == joints:
        return given
    if len(given) != 1:
        limit = f"one number, or one for each of the robot's {joints} joints"
        raise InvalidInputError([FieldError(f"robot_changes.{name}", str(given), limit)])
    return given * joints


def _motor(request: MotorRequest) -> MotorData:
    try:
        return MotorData.from_wire(request.to_wire())
    except MotorDataError as error:
        raise InvalidInputError([FieldError(f"motor.{error.field}", error.value, error.limit)]) from error


def _motor_feasible(motor: MotorData) -> list[FieldError]:
    with _NUMERICS:
        obstacle = motor_obstacle(motor)
    return [] if obstacle is None else [FieldError("motor", None, obstacle)]


def _freedom_errors(design: DesignRequest, located: list[Located], robot: Robot) -> Iterator[FieldError]:
    try:
        freedom = freedom_of(design, robot.joints)
        freedom.check(robot)
    except FreedomError as error:
        yield FieldError(f"design.{error.field}", str(error.value), error.limit)
        return
    free_gears = freedom.free_gears
    for field, task in located if free_gears else []:
        for name, speeds in (("start_speed_rad_s", task.start_speed_rad_s), ("end_speed_rad_s", task.end_speed_rad_s)):
            for k in free_gears:
                if speeds is not None and k < len(speeds) and speeds[k] != 0:
                    limit = f"0 rad/s: the gear ratio of joint {k + 1} is free"
                    yield FieldError(f"{field}.{name}[{k}]", speeds[k], limit)


def _tie_break_errors(tie_break: TieBreakRequest | None, robot: Robot) -> Iterator[FieldError]:
    if tie_break is None:
        return
    field, given = "design.tie_break.nearest_to_mm", tie_break.nearest_to_mm
    if (tie_break.by == "nearest") != (given is not None):
        yield FieldError(field, None if given is None else str(given), f"belongs to nearest; by is {tie_break.by}")
    elif given is not None and (
        [len(row) for row in given] != [len(DIMENSIONS)] * robot.joints or not all(v > 0 for row in given for v in row)
    ):
        yield FieldError(field, str(given), f"{robot.joints} rows of {len(DIMENSIONS)} lengths above 0 mm")


def _tasks(request: ApplicationRequest, robot: Robot, max_tasks: int) -> Iterator[Located]:
    given = request.tasks
    count = len(given) if isinstance(given, list) else len(given.grid.stroke) * len(given.grid.payload_kg)
    if count == 0:
        raise InvalidInputError([FieldError("tasks", "[]", "must hold at least one task")])
    if request.scatter is not None and count * request.scatter.samples > max_tasks:
        limit = f"{count} tasks of so many samples each: at most {max_tasks} tasks in one application"
        raise InvalidInputError([FieldError("scatter.samples", request.scatter.samples, limit)])
    if count > max_tasks:
        raise InvalidInputError([FieldError("tasks", count, f"at most {max_tasks} tasks in one application")])
    yield from (_listed(given) if isinstance(given, list) else _grid(given.grid, robot.joints))


def _scattered(located: list[Located], scatter: ScatterRequest, robot: Robot) -> Iterator[Located]:
    for place, (field, task) in enumerate(located):
        yield from ((field, sample) for sample in samples_of(task, place, scatter, robot))


def _listed(tasks: list[TaskRequest]) -> Iterator[Located]:
    named = [{**vars(task), "name": task.name or f"task {k}"} for k, task in enumerate(tasks)]
    yield from ((f"tasks[{k}]", task) for k, task in enumerate(_RESOLVED_TASKS.validate_python(named)))


def _grid(grid: GridRequest, joints: int) -> Iterator[Located]:
    for i, stroke in enumerate(grid.stroke):
        for payload in grid.payload_kg:
            yield (
                f"tasks.grid.stroke[{i}]",
                ResolvedTask(
                    name=f"stroke {stroke:g} rad, {payload:g} kg",
                    start_rad=[float(stroke)] * joints,
                    end_rad=[0.0] * joints,
                    payload_kg=payload,
                    duration_s=grid.duration_s,
                ),
            )


def _objective_errors(objective: ObjectiveRequest) -> Iterator[FieldError]:
    low, high = objective.final_time_bounds_s
    if not 0 < low < high <= LONGEST_TIME_S:
        limit = f"must be [low, high] in s with 0 < low < high <= {LONGEST_TIME_S:g}"
        yield FieldError("objective.final_time_bounds_s", str(objective.final_time_bounds_s), limit)
    weighted = {
        "alpha": objective.alpha,
        "time_reference_s": objective.time_reference_s,
        "energy_reference_V2s": objective.energy_reference_V2s,
    }
    if objective.kind == "weighted" and objective.alpha is None:
        yield FieldError("objective.alpha", None, "a weighted objective needs it, between 0 (time) and 1 (energy)")
    over_tasks = objective.over_tasks
    if over_tasks.kind == "mix" and over_tasks.share is None:
        yield FieldError("objective.over_tasks.share", None, "a mix needs it, between 0 (sum) and 1 (worst)")
    if over_tasks.kind != "mix" and over_tasks.share is not None:
        yield FieldError("objective.over_tasks.share", over_tasks.share, f"belongs to mix, not to {over_tasks.kind}")
    if objective.kind != "weighted":
        for name, value in weighted.items():
            if value is not None:
                yield FieldError(
                    f"objective.{name}", value, f"belongs to the weighted objective, not to {objective.kind}"
                )


def _all_within(tasks: list[ResolvedTask], ranges: Mapping[str, Range]) -> bool:
    """Whether `_task_errors` has nothing to say of any of them: asked first, of all numbers at once."""
    for name, (low, high, _) in ranges.items():
        given = [values for task in tasks if (values := getattr(task, name)) is not None]
        if any(len(values) != len(low) for values in given):
            return False
        numbers = np.array(given).reshape(-1, len(low))
        if (numbers < low).any() or (numbers > high).any():
            return False
    return True


def _task_errors(field: str, task: ResolvedTask, ranges: Mapping[str, Range]) -> Iterator[FieldError]:
    from_grid = field.startswith("tasks.grid")
    for name, (low, high, unit) in ranges.items():
        values, joints = getattr(task, name), len(low)
        if values is None:
            continue
        if len(values) != joints:
            limit = f"the robot has {joints} joints, this lists {len(values)} values"
            yield FieldError(f"{field}.{name}", str(values), limit)
            continue
        beyond = [max(least - value, value - most) for value, least, most in zip(values, low, high, strict=True)]
        wrong = [beyond.index(max(beyond))] if from_grid else range(joints)
        for k in (k for k in wrong if beyond[k] > 0):
            where = field if from_grid else f"{field}.{name}[{k}]"
            yield FieldError(where, values[k], f"joint {k + 1} allows {low[k]:.6g} to {high[k]:.6g} {unit}")


def _ranges(robot: Robot) -> dict[str, Range]:
    """What the joints allow for each field of a task that has a number a joint."""
    angle: Range = (robot.joint_lower.tolist(), robot.joint_upper.tolist(), "rad")
    speed: Range = ((-robot.joint_speed_limit).tolist(), robot.joint_speed_limit.tolist(), "rad/s")
    return {"start_rad": angle, "end_rad": angle, "start_speed_rad_s": speed, "end_speed_rad_s": speed}


def _duplicate_names(located: list[Located]) -> Iterator[FieldError]:
    seen: set[str] = set()
    for field, task in located:
        if task.name in seen:
            yield FieldError(f"{field}.name", task.name, "task names must differ")
        seen.add(task.name)


def _durations(request: ApplicationRequest, located: list[Located]) -> Iterator[FieldError]:
    limit = f"the {request.objective.kind} objective needs a duration in s for each task"
    if request.objective.kind == "energy":
        limit += ": with t_f free, slower is always better"
    if not isinstance(request.tasks, list):
        if request.tasks.grid.duration_s is None:
            yield FieldError("tasks.grid.duration_s", None, limit)
        return
    for field, task in located:
        if task.duration_s is None:
            yield FieldError(f"{field}.duration_s", None, limit)


def _methods(request: ApplicationRequest) -> list[MethodName]:
    """With a catalogue its method is compared; the others start from the two-step design, so that is too."""
    methods = request.methods
    if request.design.catalogue is not None and CATALOGUE not in methods:
        methods = [*methods, CATALOGUE]
    needs_two_step = SHARED in methods or CATALOGUE in methods
    return [*methods, "two_step"] if needs_two_step and "two_step" not in methods else methods


def _chosen_tasks(
    request: ApplicationRequest, tasks: list[ResolvedTask]
) -> tuple[dict[str, int | None], list[FieldError]]:
    """Indices of the empirical and the worst-case task; a grid defaults to its middle and last."""
    from_grid = not isinstance(request.tasks, list)
    given = {"empirical": request.empirical_task, "worst_case": request.worst_case_task}
    default = {"empirical": len(tasks) // 2, "worst_case": len(tasks) - 1}
    chosen: dict[str, int | None] = {}
    errors = []
    for method, choice in given.items():
        field = f"{method}_task"
        names = [task.name for task in tasks]
        if choice is None:
            chosen[method] = default[method] if from_grid else None
            if method in request.methods and not from_grid:
                errors.append(FieldError(field, None, f"method {method} on a task list needs a task's index or name"))
        elif isinstance(choice, int):
            chosen[method] = choice
            if not 0 <= choice < len(tasks):
                errors.append(FieldError(field, choice, f"must be a task's index, 0 to {len(tasks) - 1}"))
        elif choice in names:
            chosen[method] = names.index(choice)
        else:
            chosen[method] = None
            hint = "" if request.scatter is None else f"; with scatter they are called {names[0]!r}, ..."
            errors.append(FieldError(field, choice, f"no task has this name{hint}"))
    return chosen, errors
