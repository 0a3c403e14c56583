"""Answers as pandas data frames; every column has its unit in its name. Without pandas: `MissingExtraError`."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from armature.errors import MissingExtraError
from armature.export.designs import design_columns
from armature.export.motion_columns import TIME, motion_columns
from armature.export.tables import data_frame
from shared.contracts.comparisons import ComparisonAnswer, DesignAnswer, DesignsAnswer
from shared.contracts.motions import MotionResult, TaskResult, Trajectory

if TYPE_CHECKING:
    import pandas as pd

OWN = "own"
DIMENSIONS = "dimensions_mm"

OF_MOTION = (
    "objective",
    "final_time_s",
    "energy_V2s",
    "electrical_energy_J",
    "copper_loss_J",
    "solver_status",
    "iterations",
    "solve_time_s",
)
OF_CERTIFICATE = (
    "replay_position_rad",
    "replay_speed_rad_s",
    "limit_violation",
    "kkt_residual",
    "within_tolerance",
    "scheme",
    "degree",
    "intervals",
)


def tasks_frame(tasks: Sequence[TaskResult]) -> pd.DataFrame:
    """A row a motion, by `task` and `method`: what it costs, how the solve went, its certificate.

    A task without a motion has one row, `own`, with the reason why.
    """
    rows = [row for task in tasks for row in _task_rows(task)]
    return _frame(rows, ["task", "method", "name", "payload_kg", "weight", "state", *OF_MOTION, *OF_CERTIFICATE, "reason"], ["task", "method"])  # fmt: skip # noqa: E501


def design_frame(design: DesignAnswer) -> pd.DataFrame:
    """A row a motor, by `joint`: lengths, derived parameters, and what binds."""
    rows = [
        {"joint": motor["joint"]}
        | {f"{name}_mm": value for name, value in motor[DIMENSIONS].items()}
        | motor["parameters"]
        | {"binding": ", ".join(motor["binding"])}
        for motor in design.motors
    ]
    return _frame(rows, list(rows[0]), ["joint"])


def designs_frame(designs: DesignsAnswer) -> pd.DataFrame:
    """A row a motor of every design, by `design` (own, mean, a method), `task` and `joint`."""
    return data_frame(design_columns(designs)).set_index(["design", "task", "joint"])


def comparison_frame(comparison: ComparisonAnswer) -> pd.DataFrame:
    """A row a method: totals over the tasks that every method solved, and the regret as a share of the bound."""
    rows = []
    for method, totals in comparison.methods.items():
        values = totals.model_dump(exclude={"per_task", "design_mm"})
        regret = comparison.regret.get(method)
        rows.append({"method": method} | values | {"regret": None if regret is None else regret.total})
    return _frame(rows, list(rows[0]) if rows else ["method", "regret"], ["method"])


def regret_frame(comparison: ComparisonAnswer) -> pd.DataFrame:
    """A row a task, a column a method: by what share the objective is over that of the task's own design."""
    columns: dict[str, Sequence[Any]] = {"task": comparison.tasks_compared, "name": comparison.task_names}
    columns |= {method: regret.per_task for method, regret in comparison.regret.items()}
    return data_frame(columns).set_index(["task", "name"])


def motion_frame(motion: Trajectory) -> pd.DataFrame:
    """A row a point, by `time_s`: position, speed, torque, currents and voltages of each joint, counted from 1."""
    return data_frame(motion_columns(motion)).set_index(TIME)


def sweep_frame(csv: str) -> pd.DataFrame:
    """A sweep's table."""
    try:
        import pandas as pd
    except ImportError as error:
        raise MissingExtraError("data frames and Parquet", "tables") from error
    return pd.read_csv(io.StringIO(csv))


def _task_rows(task: TaskResult) -> Iterator[dict[str, Any]]:
    about = task.model_dump(include={"name", "payload_kg", "weight", "state", "reason"}) | {"task": task.index}
    motions = ({OWN: task.own} if task.own is not None else {}) | task.methods
    for method, motion in motions.items():
        yield about | {"method": method} | _motion_values(motion)
    if not motions:
        failed = {"solver_status": task.solver_status, "iterations": task.iterations, "solve_time_s": task.solve_time_s}
        yield about | {"method": OWN} | failed


def _motion_values(motion: MotionResult) -> dict[str, Any]:
    certificate = motion.certificate
    return {name: getattr(motion, name) for name in OF_MOTION} | {
        name: getattr(certificate, name) for name in OF_CERTIFICATE
    }


def _frame(rows: Sequence[Mapping[str, Any]], columns: Sequence[str], index: list[str]) -> pd.DataFrame:
    return data_frame({name: [row.get(name) for row in rows] for name in columns}).set_index(index)
