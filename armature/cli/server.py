"""The server that a command asks, and what is said while it makes the command wait."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

import typer

from armature.cli.consoles import messages
from armature.client import Application, Client

Url = Annotated[str, typer.Option(envvar="ARMATURE_URL", help="Address of the server.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON: the server's answer, for programs.")]


def ask(url: str) -> Client:
    """A client that says so when the server asks it to wait."""
    return Client(url, on_wait=_say_wait)


@contextmanager
def open_application(url: str, application_id: str) -> Iterator[Application]:
    """The application, while its client is open."""
    with ask(url) as client:
        yield client.application(application_id)


def _say_wait(seconds: float, why: str) -> None:
    messages().print(f"waiting {seconds:.0f} s, as the server asks: {why}", style="yellow", soft_wrap=True)
