"""What a shell offers at TAB for arguments that only a server knows; typer completes commands, options and files."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from itertools import islice

import typer

from armature.client import DEFAULT_URL, Client
from armature.errors import ArmatureError

TIMEOUT_S = 1.0
"""Nobody waits longer for a TAB."""
MOST = 50
"""Newest first."""

Offer = tuple[str, str]
"""A value, and what it is."""


def application_ids(ctx: typer.Context, incomplete: str) -> list[Offer]:
    """Ids of the newest applications, with name and state."""
    return _offers(ctx, incomplete, lambda client: ((it.id, f"{it.name}, {it.state}") for it in client.applications()))


def sweep_ids(ctx: typer.Context, incomplete: str) -> list[Offer]:
    """Ids of the newest sweeps, with name and state."""
    return _offers(ctx, incomplete, lambda client: ((it.id, f"{it.name}, {it.state}") for it in client.sweeps()))


def robot_ids(ctx: typer.Context, incomplete: str) -> list[Offer]:
    """Presets and uploads, with their names."""
    return _offers(ctx, incomplete, lambda client: ((it["id"], it["name"]) for it in client.robots()))


def _offers(ctx: typer.Context, incomplete: str, found: Callable[[Client], Iterable[Offer]]) -> list[Offer]:
    """Those that begin as what was typed; none when no server answers at once."""
    url = ctx.params.get("url") or os.environ.get("ARMATURE_URL") or DEFAULT_URL
    try:
        with Client(url, timeout_s=TIMEOUT_S, retry_waits_s=(), patience_s=0) as client:
            return list(_beginning(incomplete, islice(found(client), MOST)))
    except ArmatureError:
        return []


def _beginning(incomplete: str, offers: Iterable[Offer]) -> Iterator[Offer]:
    return (offer for offer in offers if offer[0].startswith(incomplete))
