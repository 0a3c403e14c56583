"""Submit, follow, cancel and delete sweeps."""

from __future__ import annotations

import csv
import io
from typing import Annotated

from fastapi import APIRouter, Header, Query, Request, Response

from api.access import OwnerOf
from api.context import Ctx
from services.jobs import sweeps
from shared.contracts.sweeps import AcceptedSweep, SweepList, SweepRequest, SweepStatus, SweepTotals
from shared.domain import ApplicationState

router = APIRouter(prefix="/v1/sweeps", tags=["sweeps"])

POLL_AFTER_S = "2"
QUANTITIES = tuple(SweepTotals.model_fields)


@router.post("", status_code=202)
def submit_sweep(
    body: SweepRequest,
    response: Response,
    ctx: Ctx,
    owner: OwnerOf,
    idempotency_key: Annotated[str | None, Header(min_length=1, max_length=200)] = None,
) -> AcceptedSweep:
    """Validate every combination and store them all, or none."""
    sweep_id, _ = sweeps.submit_sweep(ctx.engine, ctx.settings, body, idempotency_key, owner)
    url = f"/v1/sweeps/{sweep_id}"
    response.headers["Location"], response.headers["Retry-After"] = url, POLL_AFTER_S
    applications = sum(sweeps.sweep_status(ctx.engine, sweep_id).counts.values())
    return AcceptedSweep(id=sweep_id, applications=applications, url=url)


@router.get("")
def list_sweeps(
    ctx: Ctx, owner: OwnerOf, cursor: str | None = None, limit: Annotated[int, Query(ge=1, le=1000)] = 50
) -> SweepList:
    """Sweeps, newest first."""
    return sweeps.list_sweeps(ctx.engine, cursor, limit, owner)


@router.get("/{sweep_id}", response_model=SweepStatus, responses={200: {"content": {"text/csv": {}}}})
def get_sweep(sweep_id: str, request: Request, response: Response, ctx: Ctx) -> Response | SweepStatus:
    """State and table of results so far, as JSON, or as CSV with `Accept: text/csv`."""
    found = sweeps.sweep_status(ctx.engine, sweep_id)
    headers = {} if ApplicationState(found.state).final else {"Retry-After": POLL_AFTER_S}
    if "text/csv" in request.headers.get("accept", ""):
        return Response(_csv(found), media_type="text/csv", headers=headers)
    response.headers.update(headers)
    return found


@router.post("/{sweep_id}/cancel", status_code=202)
def cancel_sweep(sweep_id: str, ctx: Ctx) -> SweepStatus:
    """Cancel all of its applications; those at their end stay as they are."""
    sweeps.cancel_sweep(ctx.engine, sweep_id)
    return sweeps.sweep_status(ctx.engine, sweep_id)


@router.delete("/{sweep_id}", status_code=204)
def remove_sweep(sweep_id: str, ctx: Ctx) -> None:
    """Delete a sweep with all its applications."""
    sweeps.delete_sweep(ctx.engine, sweep_id)


def _csv(sweep: SweepStatus) -> str:
    """One row an application and method; a length's column is such as motor_1_L_mm."""
    motors = max((len(rows) for point in sweep.points for rows in point.designs_mm.values()), default=0)
    lengths = [f"motor_{k + 1}_{name}_mm" for k in range(motors) for name in sweep.dimensions]
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow([*sweep.axes, "application_id", "state", "method", *QUANTITIES, "objective_unit", *lengths])
    for point in sweep.points:
        about = [*(point.values[axis] for axis in sweep.axes), point.application_id, point.state]
        for method in point.totals or [""]:  # an application without results still has its row
            totals = point.totals.get(method)
            values = [""] * len(QUANTITIES) if totals is None else [getattr(totals, name) for name in QUANTITIES]
            design: list[float | str] = [value for row in point.designs_mm.get(method, []) for value in row]
            design += [""] * (len(lengths) - len(design))
            writer.writerow([*about, method, *values, point.unit, *design])
    return out.getvalue()
