"""`armature report`: an application as one file for people, and its figures for a paper."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from pydantic import BaseModel

from armature.cli.consoles import messages, output, print_json
from armature.cli.remote import Id, Json, Url, open_application
from armature.client import DEFAULT_URL, Application
from armature.whole_files import whole_file


class Written(BaseModel):
    """Files that were written."""

    report: str
    figures: list[str]


def report(
    application_id: Id,
    *,
    out: Annotated[Path, typer.Option("--out", "-o", help="The file.")] = Path("report.html"),
    pdf_figures: Annotated[
        Path | None, typer.Option("--pdf-figures", metavar="DIR", help="Write every figure as PDF too, for papers.")
    ] = None,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Write the report on an application: one HTML file that opens anywhere, without a network.

    Design drawn to scale, what binds, methods side by side, every task's result and certificate, versions, and the
    request that gives the same again.
    """
    with messages().status("drawing"), open_application(url, application_id) as application:
        page = application.report()
        with whole_file(out) as part:
            part.write_text(page, encoding="utf-8")
        figures = [] if pdf_figures is None else _draw(application, pdf_figures)
    if as_json:
        print_json(Written(report=str(out), figures=[str(path) for path in figures]))
        return
    for path in (out, *figures):
        output().print(str(path), soft_wrap=True)


def _draw(application: Application, folder: Path) -> list[Path]:
    from armature.figures import answers_of
    from services.report.figures import write_figures  # a second that no other command should wait for

    return write_figures(answers_of(application), folder, "pdf")
