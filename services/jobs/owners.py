"""Who sees what: an API key sees what it submitted, and nothing else.

An owner is the id of a key, or None where no keys are asked for; then everybody sees everything. A new kind of thing
with an `owner` column needs a line in `OWNED`, its owner set when it is made, and `owned_by` where it is listed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from sqlalchemy import ColumnElement, Engine, select, true
from sqlalchemy.orm import InstrumentedAttribute

from services.jobs.views import NotFoundError
from shared.db.engine import reading
from shared.db.tables import Application, Sweep, UploadedRobot

Owner = str | None

OWNED: Final[Mapping[str, type[Application | Sweep | UploadedRobot]]] = {
    "application_id": Application,
    "robot_id": UploadedRobot,
    "sweep_id": Sweep,
}
"""What a parameter in a path names."""


def owned_by(owner: Owner, column: InstrumentedAttribute[str | None]) -> ColumnElement[bool]:
    """The condition on a query of what an owner sees."""
    return true() if owner is None else column == owner


def refuse_others(engine: Engine, owner: Owner, path: Mapping[str, str]) -> None:
    """Deny that there is what a path names, when it belongs to somebody else.

    Raises
    ------
    NotFoundError
        With the words that are used of what there is not, so that ids cannot be tried out.
    """
    named = [(parameter, path[parameter]) for parameter in OWNED if parameter in path]
    if owner is None or not named:
        return
    with reading(engine) as session:
        for parameter, value in named:
            table = OWNED[parameter]
            found = session.execute(select(table.owner).where(table.id == value)).one_or_none()
            if found is not None and found.owner != owner:
                raise NotFoundError(f"there is no {parameter.removesuffix('_id')} {value}")
