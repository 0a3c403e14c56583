"""The database that the settings name, for commands that need no server."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from armature.errors import ArmatureError
from shared.settings import Settings

if TYPE_CHECKING:
    from sqlalchemy import Engine


class DatabaseError(ArmatureError):
    """The database of the settings cannot be used."""


@contextmanager
def open_database() -> Iterator[Engine]:
    """The settings' database, made where there is none yet; one at another revision is left alone.

    Raises
    ------
    DatabaseError
        It does not answer, or its address is none.
    """
    from shared.db.engine import make_engine
    from shared.db.migrate import upgrade
    from shared.db.revision import current_revision, require_head

    url = Settings().database_url
    with explained(url):
        engine = make_engine(url)
        try:
            if current_revision(engine) is None:
                upgrade(url)
            require_head(url)
            yield engine
        finally:
            engine.dispose()


@contextmanager
def explained(url: str) -> Iterator[None]:
    """Say of an address what is wrong with it, without the password that may be in it."""
    from sqlalchemy import make_url
    from sqlalchemy.exc import ArgumentError, OperationalError

    try:
        address = make_url(url).render_as_string(hide_password=True)
    except ArgumentError:
        raise DatabaseError(f"ARMATURE_DATABASE_URL = {url}: no address such as postgresql://user@host/name") from None
    try:
        yield
    except OperationalError as error:
        raise DatabaseError(f"the database at {address} cannot be used: {str(error.orig).splitlines()[0]}") from error
