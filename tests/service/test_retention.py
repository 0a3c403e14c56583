"""Old applications go, with all they own; young and unfinished ones stay."""

from __future__ import annotations

import pytest
from sqlalchemy import Engine, func, select, text

from services.jobs import retention
from services.jobs.retention import forget_old
from services.jobs.submit import submit
from shared.db.engine import reading, transaction
from shared.db.tables import Application, Base
from shared.settings import Settings
from tests.service.queue_actions import drain
from tests.service.requests import application


def age(engine: Engine, days: float) -> None:
    """Make everything older."""
    with transaction(engine) as session:
        session.execute(text("UPDATE applications SET finished_at = finished_at - :s"), {"s": 86_400 * days})


def test_what_is_old_and_finished_goes(engine: Engine, settings: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(retention, "BATCH", 2)
    for key in ("a", "b", "c"):
        submit(engine, settings, application(), key)
    drain(engine)
    age(engine, 10.5)
    young, _ = submit(engine, settings, application(), "young")
    drain(engine)
    unfinished, _ = submit(engine, settings, application())
    assert forget_old(engine, 0) == 0
    assert forget_old(engine, 11) == 0
    assert [forget_old(engine, 10) for _ in range(3)] == [2, 1, 0]  # in bounded batches
    with reading(engine) as session:
        assert set(session.scalars(select(Application.id))) == {young, unfinished}
        for table in Base.metadata.sorted_tables:
            if "application_id" in table.c:
                ids = set(session.scalars(select(table.c.application_id)))
                assert ids <= {young, unfinished}, table.name
        assert session.scalar(select(func.count()).select_from(Base.metadata.tables["outbox"])) == 7 + 3
    assert submit(engine, settings, application(), "a")[1]  # its key is free again
