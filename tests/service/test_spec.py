"""What applications mean, kept by a process that was asked before."""

from __future__ import annotations

import pytest
from sqlalchemy import Engine

from services.jobs import views
from services.jobs.cancel import delete_application
from services.jobs.spec import spec_of
from services.jobs.submit import submit
from shared.db.engine import reading
from shared.settings import Settings
from tests.service.requests import application


def test_what_was_deleted_is_gone_though_it_was_kept(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, application())
    with reading(engine) as session:
        kept = spec_of(session, application_id)
        assert kept is not None
        assert spec_of(session, application_id) is kept
    delete_application(engine, application_id)
    with pytest.raises(views.NotFoundError):
        views.status(engine, application_id)
