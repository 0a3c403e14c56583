"""`armature report`: an application as one file for people, and its figures for a paper."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from pydantic import BaseModel

from armature.cli.consoles import messages, output, print_json
from armature.cli.remote import Id
from armature.cli.server import Json, Url, open_application
from armature.client import DEFAULT_URL
from armature.errors import NotFoundError
from armature.whole_files import whole_file

if TYPE_CHECKING:
    from services.report.answers import Answers


class FigureFormat(StrEnum):
    """What figures are written as."""

    PDF = "pdf"
    SVG = "svg"
    PNG = "png"


class Written(BaseModel):
    """Files that were written."""

    report: str
    figures: list[str]


@dataclass(frozen=True)
class Source:
    """Where an application is read from."""

    page: Callable[[], str]
    answers: Callable[[], Answers]


def report(
    application_id: Id,
    *,
    out: Annotated[Path, typer.Option("--out", "-o", help="The file.")] = Path("report.html"),
    figures: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write every figure into this folder too, for papers.")
    ] = None,
    kind: Annotated[FigureFormat, typer.Option("--format", help="Of the figures.")] = FigureFormat.PDF,
    local: Annotated[
        bool, typer.Option("--local", help="Read this machine's database (ARMATURE_DATABASE_URL); no server is needed.")
    ] = False,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Write the report on an application: one HTML file that opens anywhere, without a network.

    Design drawn to scale, what binds, methods side by side, every task's result and certificate, versions, and the
    request that gives the same again. An application that has not ended has a report of what is known so far.
    """
    with messages().status("drawing"), _store(application_id) if local else _server(url, application_id) as source:
        page = source.page()
        with whole_file(out) as part:
            part.write_text(page, encoding="utf-8")
        drawn = [] if figures is None else _draw(source.answers(), figures, kind)
    if as_json:
        print_json(Written(report=str(out), figures=[str(path) for path in drawn]))
        return
    for path in (out, *drawn):
        output().print(str(path), soft_wrap=True)


@contextmanager
def _server(url: str, application_id: str) -> Iterator[Source]:
    """The server draws the page."""
    from armature.figures import answers_of  # slow to import, as all below

    with open_application(url, application_id) as application:
        yield Source(application.report, lambda: answers_of(application))


@contextmanager
def _store(application_id: str) -> Iterator[Source]:
    """This process draws the page, from the database of the settings."""
    from armature.cli.database import open_database
    from services.jobs import views
    from services.jobs.report import report_of
    from services.report.page import report_page

    with open_database() as engine:
        try:
            found = report_of(engine, application_id)
        except views.NotFoundError as error:
            raise NotFoundError(404, {"detail": f"{error}, in {engine.url}"}) from None
        yield Source(lambda: report_page(found), lambda: found.answers)


def _draw(answers: Answers, folder: Path, kind: FigureFormat) -> list[Path]:
    from services.report.figures import write_figures

    return write_figures(answers, folder, kind.value)
