"""The report on an application, as one HTML file."""

from __future__ import annotations

import re

import anyio.to_process
from fastapi import APIRouter
from fastapi.responses import HTMLResponse
from starlette.concurrency import run_in_threadpool

from api.context import Ctx
from services.jobs.report import report_of
from services.report.page import report_page

router = APIRouter(prefix="/v1/applications/{application_id}", tags=["results"])

HEADERS = {
    "Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}


@router.get("/report", response_class=HTMLResponse)
async def get_report(application_id: str, ctx: Ctx) -> HTMLResponse:
    """The application with its design, figures, results, certificates and how to do it again, for people.

    One file that asks for nothing else: it can be kept, sent and printed. Takes a few seconds.
    """
    report = await run_in_threadpool(report_of, ctx.engine, application_id)
    # Figures take seconds, and matplotlib knows one thread only: they are drawn in a process of their own.
    page = await anyio.to_process.run_sync(report_page, report, cancellable=True, limiter=ctx.drawing)
    name = re.sub(r"[^A-Za-z0-9._-]+", "-", report.answers.application.name).strip("-.")[:60] or "application"
    disposition = {"Content-Disposition": f'inline; filename="{name}-{application_id}.html"'}
    return HTMLResponse(page, headers=HEADERS | disposition)
