"""For the operator, in the database that the settings name: `armature migrate`, `armature key create NAME`."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.table import Table

from armature.cli.consoles import messages, output
from armature.cli.database import open_database

app = typer.Typer(help="API keys of a server (ARMATURE_API_KEYS_REQUIRED=true asks for them).", no_args_is_help=True)

Name = Annotated[str, typer.Argument(metavar="NAME", help="Who the key is for.", show_default=False)]


@app.command()
def create(name: Name) -> None:
    """Make a key and print it, this once: only its hash is kept."""
    from services.jobs.keys import create_key

    with open_database() as engine:
        key_id, secret = create_key(engine, name)
    output().print(secret, soft_wrap=True)
    messages().print(f"key {key_id} of {name}; it is not kept and cannot be shown again")


@app.command("list")
def list_all() -> None:
    """Every key: id, name, when it was made and revoked."""
    from services.jobs.keys import list_keys
    from services.jobs.views import iso_time

    with open_database() as engine:
        keys = list_keys(engine)
    table = Table("id", "name", "created", "revoked", box=None)
    for key in keys:
        table.add_row(key.id, key.name, iso_time(key.created_at), iso_time(key.revoked_at) or "")
    output().print(table)


@app.command()
def revoke(key: Annotated[str, typer.Argument(metavar="ID_OR_NAME", show_default=False)]) -> None:
    """End a key, and every browser's session with it, at once. What it submitted stays."""
    from services.jobs.keys import revoke_key

    with open_database() as engine:
        count = revoke_key(engine, key)
    if not count:
        messages().print(f"there is no valid key {key}")
        raise typer.Exit(1)
    messages().print(f"revoked: {key} ({count})" if count > 1 else f"revoked: {key}")


def migrate() -> None:
    """Bring the database of the settings to this version's revision. Once for each update, before anything starts."""
    from shared.db.migrate import head_revision, upgrade
    from shared.settings import Settings

    upgrade(Settings().database_url)
    messages().print(f"the database is at revision {head_revision()}")
