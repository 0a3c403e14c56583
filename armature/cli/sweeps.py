"""Sweeps, here and on a server: `armature sweep ...`."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Annotated

import typer

from armature.application_file import read_sweep
from armature.cli.completion import sweep_ids
from armature.cli.consoles import messages, output, print_deleted, print_json
from armature.cli.embedded import Workers, started, submit_and_follow
from armature.cli.exit_codes import exit_code_of
from armature.cli.server import Json, Url, ask
from armature.cli.sweep_tables import print_sweep, print_sweeps
from armature.client import DEFAULT_URL, new_idempotency_key
from armature.processes import Place, interrupt_on_signals
from armature.save import save_sweep
from armature.sweep import Sweep
from armature.sweep_progress import shown_sweep_progress
from shared.contracts.sweeps import AcceptedSweep, SweepList, SweepStatus
from shared.settings import Settings

app = typer.Typer(help="Sweeps: one application for every combination of values.", no_args_is_help=True)

File = Annotated[Path, typer.Argument(metavar="FILE", help="A sweep, YAML or JSON.", show_default=False)]
Id = Annotated[
    str,
    typer.Argument(
        metavar="ID", help="The sweep's id, from submit or list.", show_default=False, autocompletion=sweep_ids
    ),
]
Csv = Annotated[bool, typer.Option("--csv", help="Print the table as CSV, with every method and design.")]
Method = Annotated[str | None, typer.Option(help="own, or a method; default: each application's own.")]


@app.command()
def run(
    file: File,
    *,
    workers: Workers = None,
    out: Annotated[Path, typer.Option(help="Folder that takes the results.")] = Path("out"),
    as_json: Annotated[bool, typer.Option("--json", help="Print the sweep as JSON, not the table.")] = False,
    as_csv: Csv = False,
) -> None:
    """Work through a sweep here and now, and print its table.

    Starts what it needs, shows progress, writes the table as JSON and CSV and the figures made from it, and leaves
    nothing running. Ctrl-C cancels the sweep.
    """
    _refuse_two_forms(as_json, as_csv)
    interrupt_on_signals()
    request, settings, console = read_sweep(file), Settings(), messages()
    place = Place(workers=workers or settings.workers)
    with started(console, settings, place) as service, ask(service.url) as client:
        submit = partial(client.submit_sweep, request, idempotency_key=new_idempotency_key())
        sweep = submit_and_follow(console, service, settings, submit, shown_sweep_progress)
        folder = save_sweep(sweep, out, request)
        status = _print(sweep, None, as_json=as_json, as_csv=as_csv)
    console.print(f"\nthe table as JSON and CSV: {folder}", soft_wrap=True)
    if (figure := _front(status, folder / "front.svg")) is not None:
        console.print(f"time against energy: {figure}", soft_wrap=True)
    raise typer.Exit(exit_code_of(status.state))


@app.command()
def submit(file: File, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Submit a sweep and print its id."""
    with ask(url) as client:
        sweep = client.submit_sweep(file)
        if as_json:
            points = sweep.status().points
            print_json(AcceptedSweep(id=sweep.id, applications=len(points), url=f"/v1/sweeps/{sweep.id}"))
            return
    output().print(sweep.id)
    messages().print(f"follow it with: armature sweep watch {sweep.id}")


@app.command()
def watch(
    sweep_id: Id, *, method: Method = None, url: Url = DEFAULT_URL, as_json: Json = False, as_csv: Csv = False
) -> None:
    """Follow a sweep to its end and print its table. Ctrl-C ends only the watching."""
    _refuse_two_forms(as_json, as_csv)
    with _open(url, sweep_id) as sweep:
        try:
            with shown_sweep_progress(messages()) as show:
                sweep.wait(show)
        except KeyboardInterrupt:
            messages().print("\nthe sweep goes on; 'armature sweep cancel' ends it")
            raise
        status = _print(sweep, method, as_json=as_json, as_csv=as_csv)
    raise typer.Exit(exit_code_of(status.state))


@app.command()
def show(
    sweep_id: Id, *, method: Method = None, url: Url = DEFAULT_URL, as_json: Json = False, as_csv: Csv = False
) -> None:
    """A sweep's table as it stands."""
    _refuse_two_forms(as_json, as_csv)
    with _open(url, sweep_id) as sweep:
        _print(sweep, method, as_json=as_json, as_csv=as_csv)


@app.command("list")
def list_all(
    limit: Annotated[int, typer.Option(min=1, help="At most so many.")] = 50,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Sweeps, newest first."""
    with ask(url) as client:
        found = list(islice(client.sweeps(), limit))
    if as_json:
        print_json(SweepList(items=found, next_cursor=None))
    else:
        print_sweeps(output(), found)


@app.command()
def cancel(sweep_id: Id, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Cancel all applications of a sweep that are not at their end."""
    with _open(url, sweep_id) as sweep:
        found = sweep.cancel()
    if as_json:
        print_json(found)
    else:
        output().print(f"{found.id} {found.state}, cancel requested")


@app.command()
def delete(
    sweep_id: Id,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask.")] = False,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Delete a sweep with all its applications and their results."""
    if not yes:
        typer.confirm(f"delete sweep {sweep_id} with all its applications?", abort=True, err=True)
    with _open(url, sweep_id) as sweep:
        sweep.delete()
    print_deleted(sweep_id, as_json)


def _front(status: SweepStatus, path: Path) -> Path | None:
    """Drawn where alpha was swept; imported here, since it takes a second that no other command should wait for."""
    from services.report.front_chart import front_chart, has_front
    from services.report.style import save, style

    if not has_front(status):
        return None
    with style():
        return save(front_chart(status), path)


@contextmanager
def _open(url: str, sweep_id: str) -> Iterator[Sweep]:
    with ask(url) as client:
        yield client.sweep(sweep_id)


def _print(sweep: Sweep, method: str | None, *, as_json: bool, as_csv: bool) -> SweepStatus:
    """The sweep in the form that was asked for."""
    status = sweep.status()
    if as_csv:
        sys.stdout.write(sweep.csv())
    elif as_json:
        print_json(status)
    else:
        print_sweep(output(), status, method)
    return status


def _refuse_two_forms(as_json: bool, as_csv: bool) -> None:
    if as_json and as_csv:
        raise typer.BadParameter("give --json or --csv, not both")
