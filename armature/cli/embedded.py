"""The service started for one command: submit something, follow it to its end, leave nothing running."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from typing import Annotated, Any, Protocol, TypeVar

import typer
from rich.console import Console

from armature.errors import ArmatureError, ServerUnreachableError
from armature.processes import Place, Service, running_service
from armature.progress import COMPILING, Note
from shared.domain import ApplicationState
from shared.settings import Settings

POLL_S = 0.25
CANCEL_PATIENCE_S = 5.0
"""How long an interrupted `run` waits for its solves to stop before it stops the worker."""

Workers = Annotated[
    int | None, typer.Option(min=1, help="Solver processes; default: ARMATURE_WORKERS, or one for each core.")
]


Status_co = TypeVar("Status_co", covariant=True)


class Submitted(Protocol[Status_co]):
    """What `Application` and `Sweep` have in common."""

    id: str

    def status(self) -> Status_co:
        """As it stands."""

    def wait(
        self,
        progress: Callable[[Status_co], None] | bool | None = None,
        *,
        timeout_s: float | None = None,
        poll_s: float = POLL_S,
    ) -> Status_co:
        """Follow it to its end."""

    def cancel(self) -> Status_co:
        """Ask for an end."""


Kind = TypeVar("Kind", bound=Submitted[Any])
Shown = Callable[[Console, Note], AbstractContextManager[Callable[[Any], None]]]
"""Shows progress (`armature.progress.shown_progress`)."""


@contextmanager
def started(console: Console, settings: Settings, place: Place) -> Iterator[Service]:
    """API, relay and worker, while the block runs."""
    with ExitStack() as stack:
        with console.status("starting API, relay and worker"):
            service = stack.enter_context(running_service(settings, place))
        try:
            yield service
        except ServerUnreachableError:
            service.check()  # a process that ended says more than that it does not answer
            raise


def submit_and_follow(
    console: Console, service: Service, settings: Settings, submit: Callable[[], Kind], shown: Shown
) -> Kind:
    """Submit and follow to the end; an interruption cancels, even one that comes in the middle of the submission.

    Parameters
    ----------
    submit
        Finds the first submission again when it is called twice: with an idempotency key.
    shown
        Shows the progress of what was submitted.
    """
    if waiting := service.queued_jobs():
        console.print(f"{waiting} jobs of earlier applications are in the queue, and come first")
    try:
        submitted = submit()
        name = type(submitted).__name__.lower()
        console.print(f"{name} {submitted.id}")
        _follow(console, submitted, service, settings, shown)
    except KeyboardInterrupt:
        console.print("\ncancelling what was submitted")
        _cancel(submit())
        raise
    return submitted


def _follow(console: Console, submitted: Kind, service: Service, settings: Settings, shown: Shown) -> None:
    from services.codesign.kernels import being_built  # slow to import: it brings CasADi

    def note() -> str | None:
        return COMPILING if being_built(settings.kernel_cache) else None

    with shown(console, note) as show:

        def look(status: Any) -> None:
            service.check()
            show(status)

        submitted.wait(look, poll_s=POLL_S)


def _cancel(submitted: Submitted[Any]) -> None:
    """Cancel, and give running solves a moment to notice, so that it is seen to end."""
    with suppress(ArmatureError):
        status = submitted.cancel()
        deadline = time.monotonic() + CANCEL_PATIENCE_S
        while not ApplicationState(status.state).final and time.monotonic() < deadline:
            time.sleep(POLL_S)
            status = submitted.status()
