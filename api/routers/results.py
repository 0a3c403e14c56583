"""Tasks, motions, designs and comparison of an application."""

from __future__ import annotations

import csv
import io
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response

from api.context import Ctx
from services.jobs import overview, results, views
from services.jobs.resolved import ResolvedApplication
from shared.contracts.application import MethodName
from shared.contracts.comparisons import ComparisonAnswer, DesignAnswer, DesignsAnswer
from shared.contracts.motions import SolverLog, SolverPoint, Source, TaskList, TaskResult, Trajectory
from shared.contracts.overview import Overview, Resolved

router = APIRouter(prefix="/v1/applications/{application_id}", tags=["results"])

CSV_COLUMNS = (
    "joint_position_rad",
    "joint_speed_rad_s",
    "joint_torque_Nm",
    "current_d_A",
    "current_q_A",
    "voltage_d_V",
    "voltage_q_V",
)

Cursor = Annotated[int, Query(ge=0, description="`next_cursor` of the page before")]


@router.get("/overview")
def get_overview(application_id: str, ctx: Ctx) -> Overview:
    """Every task's state and objective at a glance, and what is running."""
    return overview.overview(ctx.engine, application_id)


@router.get("/resolved")
def get_resolved(application_id: str, ctx: Ctx) -> Resolved:
    """What the application means: robot, motor constants and tasks, every default filled in."""
    return overview.resolved(ctx.engine, application_id)


@router.get("/tasks")
def list_tasks(
    application_id: str, ctx: Ctx, cursor: Cursor = 0, limit: Annotated[int, Query(ge=1, le=1000)] = 100
) -> TaskList:
    """Tasks in their order, with what is known of them so far."""
    return views.tasks(ctx.engine, application_id, cursor, limit)


@router.get("/tasks/{task}")
def get_task(application_id: str, task: int, ctx: Ctx) -> TaskResult:
    """One task: its own optimum, and its motion with each method's design."""
    return views.task(ctx.engine, application_id, task)


@router.get("/tasks/{task}/trajectory", response_model=Trajectory, responses={200: {"content": {"text/csv": {}}}})
def get_trajectory(
    application_id: str, task: int, request: Request, ctx: Ctx, method: Source | None = None
) -> Response | Trajectory:
    """A motion on its grid, as JSON, or as CSV with `Accept: text/csv`."""
    trajectory = results.trajectory(ctx.engine, application_id, task, method)
    if "text/csv" in request.headers.get("accept", ""):
        return Response(_csv(trajectory.model_dump()), media_type="text/csv")
    # Built by us from checked arrays: validating thousands of floats once more would only cost time.
    return Response(trajectory.model_dump_json(), media_type="application/json")


@router.get("/tasks/{task}/log")
def get_log(application_id: str, task: int, ctx: Ctx, method: Source | None = None) -> SolverLog:
    """Attempts and solver iterations of a motion, failed ones included."""
    return results.log(ctx.engine, application_id, task, method)


@router.get("/tasks/{task}/solution")
def get_solution(application_id: str, task: int, ctx: Ctx, method: Source | None = None) -> SolverPoint:
    """The solver's point with its multipliers, from which the KKT residual can be recomputed."""
    return results.solver_point(ctx.engine, application_id, task, method)


@router.get("/inputs")
def get_inputs(application_id: str, ctx: Ctx) -> ResolvedApplication:
    """What the application was understood to ask, every default filled in, the robot and the tasks explicit."""
    return results.inputs(ctx.engine, application_id)


@router.get("/design")
def get_design(application_id: str, ctx: Ctx, method: MethodName | None = None) -> DesignAnswer:
    """The final design: dimensions, parameters, constraints and what binds, motor by motor."""
    return results.design(ctx.engine, application_id, method)


@router.get("/designs")
def get_designs(application_id: str, ctx: Ctx) -> DesignsAnswer:
    """Every task's own design, their mean, and each method's design."""
    return results.designs(ctx.engine, application_id)


@router.get("/comparison")
def get_comparison(application_id: str, ctx: Ctx) -> ComparisonAnswer:
    """Methods side by side, per task and in total, and their regret."""
    return results.comparison(ctx.engine, application_id)


def _csv(trajectory: dict[str, Any]) -> str:
    """One row a point; a column a quantity and joint, such as joint_position_rad_1."""
    joints = len(trajectory[CSV_COLUMNS[0]][0])
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(["time_s", *(f"{name}_{k + 1}" for name in CSV_COLUMNS for k in range(joints))])
    for point, time in enumerate(trajectory["time_s"]):
        writer.writerow([time, *(value for name in CSV_COLUMNS for value in trajectory[name][point])])
    return out.getvalue()
