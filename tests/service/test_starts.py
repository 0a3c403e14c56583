"""Several starts asked of an application: the jobs make them, and each result tells what they found."""

from __future__ import annotations

from typing import Any

import pytest
from sqlalchemy import Engine

from services.jobs import overview, views
from services.jobs.submit import submit
from shared.settings import Settings
from tests.service.test_shared_optimum import request, run


@pytest.fixture
def database_url(tmp_path: Any) -> str:
    """SQLite alone: what is tested here is not the database."""
    return f"sqlite:///{tmp_path / 'armature.db'}"


def test_every_motion_tells_what_its_starts_found(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, request(method="two_step", starts=3))
    run(engine)
    meaning = overview.resolved(engine, application_id)
    assert meaning.starts == 3
    for task in views.tasks(engine, application_id, 0, 100).items:
        for motion in (task.own, task.methods["two_step"]):
            assert motion is not None
            found = motion.starts
            assert found is not None
            objectives = [one.objective for one in found.runs if one.objective is not None]
            assert len(found.runs) == 3
            assert found.solved == len(objectives) == sum(end.starts for end in found.ends)
            assert motion.objective == found.ends[0].objective == min(objectives)
            assert motion.iterations == sum(one.iterations for one in found.runs)


def test_one_start_tells_nothing(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, request(method="two_step"))
    run(engine)
    own = views.tasks(engine, application_id, 0, 100).items[0].own
    assert own is not None
    assert own.starts is None
