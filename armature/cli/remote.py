"""Commands that ask a server.

Each is a few lines over `armature.Client`. With `--json` they print what the server answered.
"""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from typing import Annotated

import typer

from armature.cli import tables
from armature.cli.completion import application_ids
from armature.cli.consoles import messages, output, print_deleted, print_json
from armature.cli.exit_codes import exit_code_of
from armature.cli.server import Json, Url, ask, open_application
from armature.client import DEFAULT_URL
from armature.progress import shown_progress
from shared.contracts.motions import TaskList
from shared.contracts.states import Accepted, ApplicationList
from shared.domain import ApplicationState

Id = Annotated[
    str,
    typer.Argument(
        metavar="ID",
        help="The application's id, from submit or list.",
        show_default=False,
        autocompletion=application_ids,
    ),
]


def submit(
    file: Annotated[Path, typer.Argument(help="An application, YAML or JSON.")],
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Submit an application and print its id."""
    with ask(url) as client:
        application = client.submit(file)
        if as_json:
            status = application.status()
            print_json(Accepted(id=status.id, state=status.state, url=f"/v1/applications/{status.id}"))
            return
    output().print(application.id)
    messages().print(f"follow it with: armature watch {application.id}")


def status(application_id: Id, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """State and progress of an application."""
    with open_application(url, application_id) as application:
        found = application.status()
    if as_json:
        print_json(found)
    else:
        tables.print_status(output(), found)


def watch(application_id: Id, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Follow an application to its end; the exit code tells how it ended. Ctrl-C ends only the watching."""
    with open_application(url, application_id) as application:
        try:
            with shown_progress(messages()) as show:
                found = application.wait(show)
        except KeyboardInterrupt:
            messages().print("\nthe application goes on; 'armature cancel' ends it")
            raise
    if as_json:
        print_json(found)
    else:
        tables.print_status(output(), found)
    raise typer.Exit(exit_code_of(found.state))


def tasks(application_id: Id, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Every task: its own optimum, its motion with each design, and why it failed."""
    with open_application(url, application_id) as application:
        found = application.tasks()
        if as_json:
            print_json(TaskList(items=found, next_cursor=None))
            return
        about = application.status()
    tables.print_tasks(output(), found, about.methods, about.objective.kind)
    tables.print_failures(output(), found, about.methods)


def design(
    application_id: Id,
    method: Annotated[str | None, typer.Option(help="Default: the application's own.")] = None,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """The design for all tasks, motor by motor, and what binds."""
    with open_application(url, application_id) as application:
        found = application.design(method)
    if as_json:
        print_json(found)
    else:
        tables.print_design(output(), found)


def designs(application_id: Id, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """The tasks' own designs, their mean, and each method's design."""
    with open_application(url, application_id) as application:
        found = application.designs()
    if as_json:
        print_json(found)
    else:
        tables.print_designs(output(), found)


def comparison(application_id: Id, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Methods side by side: totals, regret, and heat maps of a grid."""
    with open_application(url, application_id) as application:
        found = application.comparison()
    if as_json:
        print_json(found)
    else:
        tables.print_comparison(output(), found)


def cancel(application_id: Id, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Cancel an application: what is queued at once, what runs within a second or two."""
    with open_application(url, application_id) as application:
        found = application.cancel()
    if as_json:
        print_json(found)
    elif found.cancel_requested:
        output().print(f"{found.id} {found.state}, cancel requested")
    else:
        output().print(f"{found.id} had ended before: {found.state}")


def stop_search(application_id: Id, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """End the search for a shared design: the best one found so far is used, and the application goes on."""
    with open_application(url, application_id) as application:
        found = application.stop_search()
    if as_json:
        print_json(found)
    else:
        output().print(f"{found.id} {found.state}, goes on with the best shared design found so far")


def retry(application_id: Id, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Do again what failed, died or was cancelled, and what depends on it; what is good stays."""
    with open_application(url, application_id) as application:
        found = application.retry()
    if as_json:
        print_json(found)
    else:
        output().print(f"{found.id} {found.state}; follow it with: armature watch {found.id}")


def delete(
    application_id: Id,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask.")] = False,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Delete an application with all its results."""
    if not yes:
        typer.confirm(f"delete application {application_id} with all its results?", abort=True, err=True)
    with open_application(url, application_id) as application:
        application.delete()
    print_deleted(application_id, as_json)


def list_applications(
    state: Annotated[ApplicationState | None, typer.Option(help="Only those in this state.")] = None,
    tag: Annotated[str | None, typer.Option(help="Only those with this tag.")] = None,
    limit: Annotated[int, typer.Option(min=1, help="At most so many.")] = 50,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Applications, newest first."""
    with ask(url) as client:
        found = list(islice(client.applications(state=state, tag=tag), limit))
    if as_json:
        print_json(ApplicationList(items=found, next_cursor=None))
    else:
        tables.print_list(output(), found)
