"""Commands that start the service on this machine: `run` and `up`."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from pydantic import BaseModel

from armature.application_file import read_application
from armature.cli.consoles import messages, output, print_json
from armature.cli.embedded import Workers, started, submit_and_follow
from armature.cli.exit_codes import exit_code_of
from armature.cli.reference import reference_beside
from armature.cli.server import Json, ask
from armature.cli.show_results import show_results
from armature.client import new_idempotency_key
from armature.processes import LOOPBACK, Place, Service, interrupt_on_signals
from armature.progress import shown_progress
from armature.save import save_results
from armature.whole_files import whole_file
from shared.settings import Settings

LOOK_EVERY_S = 0.25


class Listening(BaseModel):
    """Answer of `up`."""

    url: str
    workers: int
    database: str
    logs: str


def run(
    file: Annotated[Path, typer.Argument(help="An application, YAML or JSON.")],
    workers: Workers = None,
    out: Annotated[Path, typer.Option(help="Folder that takes the results.")] = Path("out"),
    as_json: Annotated[bool, typer.Option("--json", help="Print the final status as JSON, not the tables.")] = False,
) -> None:
    """Design the motors for one application, here and now.

    Starts what it needs, shows progress, prints the design and the comparison, writes a report, every result as JSON
    and the figures made from them, and leaves nothing running. Ctrl-C cancels the application.
    """
    interrupt_on_signals()
    request, reference = read_application(file), reference_beside(file)
    settings = Settings()
    console = messages()
    place = Place(workers=workers or settings.workers)
    with started(console, settings, place) as service, ask(service.url) as client:
        key = new_idempotency_key()
        submit = partial(client.submit, request, idempotency_key=key)
        application = submit_and_follow(console, service, settings, submit, shown_progress)
        status = application.status()
        folder = save_results(application, out, request)
        with console.status("drawing"), whole_file(folder / "report.html") as part:
            part.write_text(application.report(), encoding="utf-8")
        if as_json:
            print_json(status)
        else:
            show_results(output(), application, status, reference)
    console.print(f"\nreport: {folder / 'report.html'}, for any browser", soft_wrap=True)
    console.print(f"every result as JSON: {folder}", soft_wrap=True)
    if figures := _figures(folder):
        console.print(f"figures: {folder / 'figures'} ({', '.join(path.stem for path in figures)})", soft_wrap=True)
    raise typer.Exit(exit_code_of(status.state))


def up(
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the API; 0: any free one.")] = 8000,
    host: Annotated[str, typer.Option(help="Address to listen on; 0.0.0.0: all of this machine's.")] = LOOPBACK,
    workers: Workers = None,
    as_json: Json = False,
) -> None:
    """Start API, relay and workers on this machine, until Ctrl-C.

    Everything is kept in ARMATURE_HOME (default ~/.armature), or where ARMATURE_DATABASE_URL and ARMATURE_BROKER_URL
    say.
    """
    interrupt_on_signals()
    settings = Settings()
    place = Place(host, port, workers or settings.workers, settings.drain_s)
    console = messages()
    with started(console, settings, place) as service:
        _say_where(service, place, settings, as_json)
        try:
            while True:
                service.check()
                time.sleep(LOOK_EVERY_S)
        except KeyboardInterrupt:
            console.print(f"\nstopping; solves at hand get {settings.drain_s:g} s (Ctrl-C again: at once)")
            raise


def _figures(folder: Path) -> list[Path]:
    """Draw what was saved; imported here, since it takes a second that no other command should wait for."""
    from services.report.answers import read_answers
    from services.report.figures import write_figures

    return write_figures(read_answers(folder), folder / "figures")


def _say_where(service: Service, place: Place, settings: Settings, as_json: bool) -> None:
    """At once, though the output may be a pipe: whoever started this waits for the address."""
    database = _without_password(settings.database_url)
    console = messages()
    if as_json:
        print_json(Listening(url=service.url, workers=place.workers, database=database, logs=str(service.logs)))
    else:
        output().print(f"Armature listens on {service.url} with {place.workers} solver processes", soft_wrap=True)
        console.print(f"open:     {service.url} in a browser")
        console.print(f"database: {database}\nlogs:     {service.logs}")
        console.print(f"submit:   armature submit FILE --url {service.url}")
    console.print("Ctrl-C stops it")


def _without_password(database_url: str) -> str:
    from sqlalchemy import make_url

    return make_url(database_url).render_as_string(hide_password=True)
