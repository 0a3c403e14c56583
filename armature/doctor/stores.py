"""Database and broker, as the settings name them."""

from __future__ import annotations

import os
from pathlib import Path

from sqlalchemy import URL, Engine, make_url, text
from sqlalchemy.exc import ArgumentError, SQLAlchemyError

from armature.doctor.finding import Finding, fail, ok, warn
from shared.db.engine import make_engine
from shared.db.migrate import is_known
from shared.db.revision import HEAD, current_revision
from shared.settings import Settings

CONNECT_TIMEOUT_S = 5
CHECK_URL = "check ARMATURE_DATABASE_URL, and that the server runs and lets this machine in"
RESTORE = "stop the service and restore the file from a backup, or move it away for a new, empty one"


def database(settings: Settings) -> Finding:
    """Whether the database answers, is whole, and is at this version's revision."""
    try:
        url = make_url(settings.database_url)
    except ArgumentError as error:
        return fail("database", f"ARMATURE_DATABASE_URL is no URL: {error}", CHECK_URL)
    sqlite = url.get_backend_name() == "sqlite"
    shown = url.database if sqlite else url.render_as_string(hide_password=True)
    if sqlite and url.database and not Path(url.database).exists():
        return _not_there_yet(Path(url.database))
    try:
        engine = make_engine(_in_good_time(url).render_as_string(hide_password=False))
        try:
            return _revision(engine, str(shown), sqlite)
        finally:
            engine.dispose()
    except (SQLAlchemyError, ImportError, OSError) as error:
        said = str(getattr(error, "orig", None) or error).strip().splitlines()[0]
        return fail("database", f"{shown}: {said}", RESTORE if sqlite else CHECK_URL)


def broker(settings: Settings) -> Finding:
    """Whether the broker answers."""
    from shared.dispatch.broker import broker_reachable, celery_app

    shown = _without_password(settings.broker_url)
    if (folder := shown.removeprefix("embedded://")) != shown and not Path(folder).exists():
        return ok("broker", f"{folder} is not there yet; 'armature up' makes it")
    advice = "check ARMATURE_BROKER_URL, and that the broker runs and lets this machine in"
    try:
        there = broker_reachable(celery_app(settings.broker_url), CONNECT_TIMEOUT_S)
    except Exception as error:  # whatever the URL's transport raises
        return fail("broker", f"{shown}: {error}", advice)
    return ok("broker", shown) if there else fail("broker", f"{shown} does not answer", advice)


def _not_there_yet(path: Path) -> Finding:
    place = next(folder for folder in path.parents if folder.exists())
    if not os.access(place, os.W_OK):
        return fail("database", f"{place} cannot be written to", "set ARMATURE_HOME to a folder of yours")
    return ok("database", f"{path} is not there yet; 'armature up' makes it")


def _in_good_time(url: URL) -> URL:
    """A server that does not answer is not waited for as long as the system would."""
    is_server = url.get_backend_name() == "postgresql"
    return url.update_query_dict({"connect_timeout": str(CONNECT_TIMEOUT_S)}) if is_server else url


def _revision(engine: Engine, shown: str, sqlite: bool) -> Finding:
    if sqlite:
        with engine.connect() as connection:
            said = connection.execute(text("PRAGMA quick_check(1)")).scalar_one()
        if said != "ok":
            return fail("database", f"{shown} is damaged: {said}", RESTORE)
    current = current_revision(engine)
    found = f"{shown} at revision {current or 'none'}"
    if current == HEAD:
        return ok("database", found)
    if current is not None and not is_known(current):
        advice = "install the version that wrote it, or a newer one"
        return fail("database", f"{found}, which this version does not know", advice)
    behind = f"{found}, this version needs {HEAD}"
    if sqlite:
        return warn("database", behind, "the next 'armature up' or 'armature run' brings it there")
    return fail("database", behind, "run 'armature migrate', after a backup")


def _without_password(url: str) -> str:
    try:
        return make_url(url).render_as_string(hide_password=True)
    except ArgumentError:
        return url
