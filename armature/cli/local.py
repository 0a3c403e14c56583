"""Commands that start the service on this machine: `run` and `up`."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from armature.application_file import read_application
from armature.cli.consoles import messages, output, print_json
from armature.cli.exit_codes import exit_code_of
from armature.cli.reference import reference_beside
from armature.cli.show_results import show_results
from armature.client import Application, Client, new_idempotency_key
from armature.errors import ArmatureError, ServerUnreachableError
from armature.processes import LOOPBACK, Place, Service, interrupt_on_signals, running_service
from armature.progress import shown_progress
from armature.save import save_results
from shared.contracts.results import ApplicationStatus
from shared.domain import ApplicationState
from shared.settings import Settings

POLL_S = 0.25
CANCEL_PATIENCE_S = 5.0
"""How long an interrupted `run` waits for its solves to stop before it stops the worker."""

Workers = Annotated[
    int | None, typer.Option(min=1, help="Solver processes; default: ARMATURE_WORKERS, or one for each core.")
]


def run(
    file: Annotated[Path, typer.Argument(help="An application, YAML or JSON.")],
    workers: Workers = None,
    out: Annotated[Path, typer.Option(help="Folder that takes the results.")] = Path("out"),
    as_json: Annotated[bool, typer.Option("--json", help="Print the final status as JSON, not the tables.")] = False,
) -> None:
    """Design the motors for one application, here and now.

    Starts what it needs, shows progress, prints the design and the comparison, writes every result as JSON and the
    figures made from them, and leaves nothing running. Ctrl-C cancels the application.
    """
    interrupt_on_signals()
    request, reference = read_application(file), reference_beside(file)
    settings = Settings()
    console = messages()
    place = Place(workers=workers or settings.workers)
    with _started(console, settings, place) as service, Client(service.url) as client:
        application, status = _submit_and_wait(console, client, service, settings, request)
        folder = save_results(application, out, request)
        if as_json:
            print_json(status)
        else:
            show_results(output(), application, status, reference)
    console.print(f"\nevery result as JSON: {folder}", soft_wrap=True)
    if figures := _figures(folder):
        console.print(f"figures: {folder / 'figures'} ({', '.join(path.stem for path in figures)})", soft_wrap=True)
    raise typer.Exit(exit_code_of(status.state))


def up(
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the API; 0: any free one.")] = 8000,
    host: Annotated[str, typer.Option(help="Address to listen on; 0.0.0.0: all of this machine's.")] = LOOPBACK,
    workers: Workers = None,
) -> None:
    """Start API, relay and workers on this machine, until Ctrl-C.

    Everything is kept in ARMATURE_HOME (default ~/.armature), or where ARMATURE_DATABASE_URL and ARMATURE_BROKER_URL
    say.
    """
    interrupt_on_signals()
    settings = Settings()
    place = Place(host, port, workers or settings.workers, settings.drain_s)
    console = messages()
    with _started(console, settings, place) as service:
        output().print(f"Armature listens on {service.url} with {place.workers} solver processes", soft_wrap=True)
        console.print(f"open:     {service.url} in a browser")
        console.print(f"database: {_without_password(settings.database_url)}\nlogs:     {service.logs}")
        console.print(f"submit:   armature submit FILE --url {service.url}\nCtrl-C stops it")
        try:
            while True:
                service.check()
                time.sleep(POLL_S)
        except KeyboardInterrupt:
            console.print(f"\nstopping; solves at hand get {settings.drain_s:g} s (Ctrl-C again: at once)")
            raise


@contextmanager
def _started(console: Console, settings: Settings, place: Place) -> Iterator[Service]:
    with ExitStack() as stack:
        with console.status("starting API, relay and worker"):
            service = stack.enter_context(running_service(settings, place))
        try:
            yield service
        except ServerUnreachableError:
            service.check()  # a process that ended says more than that it does not answer
            raise


def _submit_and_wait(
    console: Console, client: Client, service: Service, settings: Settings, request: dict[str, Any]
) -> tuple[Application, ApplicationStatus]:
    """Submit and follow to the end; an interruption cancels, even one that comes in the middle of the submission."""
    if waiting := service.queued_jobs():
        console.print(f"{waiting} jobs of earlier applications are in the queue, and come first")
    key = new_idempotency_key()
    try:
        application = client.submit(request, idempotency_key=key)
        console.print(f"application {application.id}")
        return application, _follow(console, application, service, settings)
    except KeyboardInterrupt:
        console.print("\ncancelling the application")
        _cancel(client.submit(request, idempotency_key=key))  # the key finds it again
        raise


def _follow(console: Console, application: Application, service: Service, settings: Settings) -> ApplicationStatus:
    from services.codesign.kernels import being_built  # slow to import: it brings CasADi

    def note() -> str | None:
        return "compiling the arm's equations, once" if being_built(settings.kernel_cache) else None

    with shown_progress(console, note) as show:

        def look(status: ApplicationStatus) -> None:
            service.check()
            show(status)

        return application.wait(look, poll_s=POLL_S)


def _figures(folder: Path) -> list[Path]:
    """Draw what was saved; imported here, since it takes a second that no other command should wait for."""
    from services.report.answers import read_answers
    from services.report.figures import write_figures

    return write_figures(read_answers(folder), folder / "figures")


def _cancel(application: Application) -> None:
    """Cancel, and give running solves a moment to notice, so that the application is seen to end."""
    with suppress(ArmatureError):
        status = application.cancel()
        deadline = time.monotonic() + CANCEL_PATIENCE_S
        while not ApplicationState(status.state).final and time.monotonic() < deadline:
            time.sleep(POLL_S)
            status = application.status()


def _without_password(database_url: str) -> str:
    from sqlalchemy import make_url

    return make_url(database_url).render_as_string(hide_password=True)
