"""A search for a shared design that is asked to end: at once, with the best design so far; the application goes on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import Engine, select

from api.app import create_app
from services.codesign.solver import IterationReport, SolverOptions
from services.jobs import find_shared_optimum, results, views
from services.jobs.cancel import cancel
from services.jobs.claim import Claim, claim, renew, requests_of
from services.jobs.execute import execute
from services.jobs.finish import Outcome, finish
from services.jobs.retry import retry
from services.jobs.stop_search import NoSearchError, stop_search
from services.jobs.submit import submit
from services.jobs.work import load_work
from shared.db.engine import reading
from shared.db.tables import Application, Event, Job
from shared.domain import ApplicationState, JobState, Stage
from shared.settings import Settings
from tests.service.queue_actions import outcome_of, queued
from tests.service.test_shared_optimum import request
from worker.run_job import run_job

LEASE_S = 600.0


@pytest.fixture
def database_url(tmp_path: Any) -> str:
    """SQLite alone: what is tested here is not the database."""
    return f"sqlite:///{tmp_path / 'armature.db'}"


def perform(engine: Engine, held: Claim, stops: Callable[[IterationReport], bool] = lambda _: False) -> None:
    """Do a job; `stops` sees each iteration of it, and says when people have had enough of a search."""
    enough = False

    def progress(report: IterationReport) -> bool:
        nonlocal enough
        enough = enough or stops(report)
        return False

    work = load_work(engine, held)
    assert work is not None
    assert finish(engine, held, execute(work, SolverOptions(), progress, lambda: enough))


def until_the_search(engine: Engine, settings: Settings) -> tuple[str, str]:
    """An application whose search waits; its id and the job's."""
    application_id, _ = submit(engine, settings, request())
    while True:
        with reading(engine) as session:
            waiting = session.execute(select(Job.id, Job.stage).where(Job.state == JobState.QUEUED)).all()
        if waiting[0].stage == Stage.SHARED_OPTIMUM:
            return application_id, waiting[0].id
        for job in waiting:
            perform(engine, taken(engine, job.id))


def taken(engine: Engine, job_id: str) -> Claim:
    """A claim on a job."""
    held = claim(engine, job_id, "worker", LEASE_S)
    assert held is not None
    return held


def finish_all(engine: Engine) -> None:
    """Do whatever is queued."""
    while ids := queued(engine):
        for job_id in ids:
            perform(engine, taken(engine, job_id))


def state_of(engine: Engine, application_id: str) -> str:
    """An application's."""
    with reading(engine) as session:
        return session.get_one(Application, application_id).state


def totals(engine: Engine, application_id: str) -> dict[str, float]:
    """What each method is judged by."""
    methods = results.comparison(engine, application_id).methods
    return {name: method.weighted_objective for name, method in methods.items()}


@pytest.mark.parametrize("last", [0, 3])
def test_stopped_early_it_keeps_the_best_design_known(engine: Engine, settings: Settings, last: int) -> None:
    """Within one iteration; what the solver had by then is worse, and is not used."""
    application_id, job_id = until_the_search(engine, settings)
    perform(engine, taken(engine, job_id), lambda report: report.iteration == last)
    finish_all(engine)
    assert state_of(engine, application_id) == ApplicationState.SUCCEEDED
    stored = results.designs(engine, application_id).methods
    shared = stored["shared_optimum"]
    assert shared.stopped is True
    assert shared.convergence is not None
    assert [iteration for iteration, _ in shared.convergence] == list(range(last + 1))
    assert shared.start is not None
    np.testing.assert_allclose(shared.design_mm, stored[shared.start].design_mm, rtol=1e-12)
    found = totals(engine, application_id)
    assert found["shared_optimum"] == pytest.approx(min(found[name] for name in found if name != "own"))


def test_stopped_late_it_uses_where_it_stood(engine: Engine, settings: Settings) -> None:
    """A feasible design, not the optimum yet, and better than every other method's."""
    application_id, job_id = until_the_search(engine, settings)
    held = taken(engine, job_id)
    work = load_work(engine, held)
    assert work is not None
    assert work.shared is not None
    start = work.shared
    perform(engine, held, lambda report: report.iteration > 3 and report.objective < 0.999 * start.total)
    finish_all(engine)
    shared = results.designs(engine, application_id).methods["shared_optimum"]
    assert shared.stopped is True
    assert shared.kkt_residual is None or shared.kkt_residual > 1e-6  # not the optimum
    assert np.abs(np.array(shared.design_mm) / (start.start.design * 1e3) - 1).max() > 1e-3
    for motor in results.design(engine, application_id, "shared_optimum").motors:
        assert all(limit["slack"] > -1e-6 * abs(limit["limit"]) for limit in motor["constraints"].values())
    found = totals(engine, application_id)
    assert found["shared_optimum"] < min(found[name] for name in ("two_step", "empirical", "worst_case"))


def test_a_design_that_its_tasks_do_not_confirm_is_not_used(
    engine: Engine, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An iterate may promise what its motions cannot keep."""
    application_id, job_id = until_the_search(engine, settings)
    held = taken(engine, job_id)
    work = load_work(engine, held)
    assert work is not None
    assert work.shared is not None
    known = work.shared
    searching = find_shared_optimum.solve_shared

    def promising(*arguments: Any, **more: Any) -> Any:
        found = searching(*arguments, **more)
        vars(found)["objective"] = 0.5 * known.total
        vars(found)["reached"] = known.start.design * 1.3
        return found

    monkeypatch.setattr(find_shared_optimum, "solve_shared", promising)
    perform(engine, held, lambda report: report.iteration == 2)
    finish_all(engine)
    shared = results.designs(engine, application_id).methods["shared_optimum"]
    np.testing.assert_allclose(shared.design_mm, known.start.design * 1e3, rtol=1e-12)


def test_a_cancel_is_a_cancel_all_the_same(engine: Engine, settings: Settings) -> None:
    application_id, job_id = until_the_search(engine, settings)
    held = taken(engine, job_id)
    assert cancel(engine, application_id)
    assert stop_search(engine, application_id)
    pulse = renew(engine, held, LEASE_S)
    assert (pulse.mine, pulse.cancelled, pulse.search_stopped) == (True, True, True)
    work = load_work(engine, held)
    assert work is not None
    assert execute(work, SolverOptions(), lambda _: True).state == JobState.CANCELLED
    perform(engine, held, lambda _: True)
    assert state_of(engine, application_id) == ApplicationState.CANCELLED


def test_a_worker_sees_it(engine: Engine, settings: Settings) -> None:
    """Asked for while it waits: the worker that takes it ends it at its first look, and the application goes on."""
    application_id, job_id = until_the_search(engine, settings)
    assert views.status(engine, application_id).search == "running"
    assert stop_search(engine, application_id)
    assert stop_search(engine, application_id)  # asked twice
    assert views.status(engine, application_id).search == "stopping"
    run_job(engine, settings.model_copy(update={"cancel_poll_s": 0.001}), job_id)
    assert views.status(engine, application_id).search is None
    assert results.designs(engine, application_id).methods["shared_optimum"].stopped is True
    finish_all(engine)
    assert state_of(engine, application_id) == ApplicationState.SUCCEEDED
    with reading(engine) as session:
        kinds = list(session.scalars(select(Event.kind).where(Event.application_id == application_id)))
    assert kinds.count("stop_search") == 1


def test_a_search_that_is_begun_again_is_a_new_one(engine: Engine, settings: Settings) -> None:
    """The request belongs to the search that ran, not to the one after a retry."""
    application_id, job_id = until_the_search(engine, settings)
    held = taken(engine, job_id)
    assert stop_search(engine, application_id)
    assert cancel(engine, application_id)
    assert finish(engine, held, Outcome(JobState.CANCELLED))
    assert retry(engine, application_id)
    again = taken(engine, queued(engine)[0])
    assert again.spec.stage == Stage.SHARED_OPTIMUM
    assert not requests_of(engine, again).search_stopped


@pytest.fixture
def http(settings: Settings) -> Iterator[TestClient]:
    """The API in this process."""
    with TestClient(create_app(settings)) as client:
        yield client


def test_over_http(http: TestClient, engine: Engine, settings: Settings) -> None:
    assert http.post("/v1/applications/nothing/stop_search").status_code == 404
    application_id, _ = submit(engine, settings, request())
    path = f"/v1/applications/{application_id}"
    refused = http.post(f"{path}/stop_search")
    assert refused.status_code == 409
    assert "no search for a shared design is running; the application is queued" in refused.json()["detail"]
    while queued(engine):
        for job_id in queued(engine):
            held = taken(engine, job_id)
            if held.spec.stage == Stage.SHARED_OPTIMUM:
                answer = http.post(f"{path}/stop_search")
                assert (answer.status_code, answer.json()["search"]) == (202, "stopping")
            assert finish(engine, held, outcome_of(held))
    assert http.get(path).json()["search"] is None
    assert http.post(f"{path}/stop_search").status_code == 409


def test_nobody_can_stop_what_has_ended(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, request())
    assert cancel(engine, application_id)
    with pytest.raises(NoSearchError, match="cancelled"):
        stop_search(engine, application_id)
