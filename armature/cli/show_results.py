"""Everything about a finished application, in the order in which a person wants it."""

from __future__ import annotations

from contextlib import suppress

from rich.console import Console

from armature.cli import tables
from armature.cli.reference import Reference
from armature.client import Application
from armature.errors import NotFoundError
from shared.contracts.states import ApplicationStatus


def show_results(
    console: Console, application: Application, status: ApplicationStatus, reference: Reference | None = None
) -> None:
    """Design, what binds, failed tasks, comparison; what there is not is left out."""
    console.print()
    tables.print_status(console, status)
    console.print()
    tasks = application.tasks()
    with suppress(NotFoundError):
        tables.print_design(console, application.design())
        console.print()
    tables.print_failures(console, tasks, status.methods)
    try:
        comparison = application.comparison()
    except NotFoundError:
        return
    if reference is not None and reference.unit != comparison.unit:
        reference = None
    tables.print_comparison(console, comparison, reference)
    if reference is not None:
        console.print()
        tables.print_reference_tasks(console, reference, tasks)
        console.print(f"reference: {reference.source}", soft_wrap=True)
