"""For the operator, in the database that the settings name: `armature migrate`, `armature key create NAME`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer
from rich.table import Table

from armature.cli.consoles import messages, output, print_json
from armature.cli.database import explained, open_database
from armature.cli.exit_codes import ExitCode
from armature.cli.server import Json
from shared.settings import Settings

app = typer.Typer(help="API keys of a server (ARMATURE_API_KEYS_REQUIRED=true asks for them).", no_args_is_help=True)

Name = Annotated[str, typer.Argument(metavar="NAME", help="Who the key is for.", show_default=False)]


@app.command()
def create(name: Name, as_json: Json = False) -> None:
    """Make a key and print it, this once: only its hash is kept."""
    from services.jobs.keys import create_key

    with open_database() as engine:
        key_id, secret = create_key(engine, name)
    if as_json:
        print_json({"id": key_id, "name": name, "key": secret})
    else:
        output().print(secret, soft_wrap=True)
    messages().print(f"key {key_id} of {name}; it is not kept and cannot be shown again")


@app.command("list")
def list_all(as_json: Json = False) -> None:
    """Every key: id, name, when it was made and revoked."""
    from services.jobs.keys import list_keys
    from services.jobs.views import iso_time

    with open_database() as engine:
        keys = list_keys(engine)
    rows = [
        asdict(key) | {"created_at": iso_time(key.created_at), "revoked_at": iso_time(key.revoked_at)} for key in keys
    ]
    if as_json:
        print_json({"items": rows})
        return
    table = Table("id", "name", "created", "revoked", box=None)
    for row in rows:
        table.add_row(row["id"], row["name"], row["created_at"], row["revoked_at"] or "")
    output().print(table)


@app.command()
def revoke(
    key: Annotated[str, typer.Argument(metavar="ID_OR_NAME", show_default=False)], as_json: Json = False
) -> None:
    """End a key, and every browser's session with it, at once. What it submitted stays."""
    from services.jobs.keys import revoke_key

    with open_database() as engine:
        count = revoke_key(engine, key)
    if as_json:
        print_json({"key": key, "revoked": count})
    if not count:
        messages().print(f"there is no valid key {key}")
        raise typer.Exit(ExitCode.NOT_FOUND)
    messages().print(f"revoked: {key} ({count})" if count > 1 else f"revoked: {key}")


def migrate(as_json: Json = False) -> None:
    """Bring the database of the settings to this version's revision. Once for each update, before anything starts."""
    from shared.db.migrate import upgrade
    from shared.db.revision import HEAD

    url = Settings().database_url
    with explained(url):
        upgrade(url)
    if as_json:
        print_json({"revision": HEAD})
    messages().print(f"the database is at revision {HEAD}")
