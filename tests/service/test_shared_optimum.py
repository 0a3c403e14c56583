"""The shared optimum through the jobs: it starts from the best design there is, and is never worse than that."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from sqlalchemy import Engine, select

from services.codesign.optimality import Optimality
from services.codesign.shared_optimum import SharedOptimum
from services.codesign.solver import SolverOptions
from services.jobs import find_shared_optimum, results
from services.jobs.claim import claim
from services.jobs.execute import execute
from services.jobs.finish import finish
from services.jobs.store import MOTION_STAGES
from services.jobs.submit import submit
from services.jobs.work import Work, load_work
from shared.contracts.application import ApplicationRequest
from shared.contracts.errors import InvalidInputError
from shared.db.engine import reading
from shared.db.tables import Application, Job, Result
from shared.domain import ApplicationState, JobState
from shared.settings import Settings
from tests.service.requests import HOME

QUICK = {"scheme": "radau", "degree": 1, "intervals": 10, "control": "voltage"}


@pytest.fixture
def database_url(tmp_path: Any) -> str:
    """SQLite alone: what is tested here is not the database."""
    return f"sqlite:///{tmp_path / 'armature.db'}"


def request(**changes: Any) -> ApplicationRequest:
    """Two unlike tasks; the heavy one counts double."""
    tasks = [
        {"name": "short", "start_rad": [0.2] * 6, "end_rad": HOME, "payload_kg": 4.0, "weight": 2.0},
        {"name": "long", "start_rad": [1.0] * 6, "end_rad": HOME},
    ]
    chosen = {"empirical_task": "short", "worst_case_task": "long"}
    body = {"name": "two", "tasks": tasks, "transcription": QUICK, "compare": ["empirical", "worst_case"], **chosen}
    return ApplicationRequest(**{**body, "method": "shared_optimum", **changes})


def run(engine: Engine) -> list[Work]:
    """Execute whatever is queued until nothing is; returns the work of the shared optimum."""
    shared = []
    while True:
        with reading(engine) as session:
            ids = list(session.scalars(select(Job.id).where(Job.state == JobState.QUEUED)))
        if not ids:
            return shared
        for job_id in ids:
            held = claim(engine, job_id, "worker", 60.0)
            assert held is not None
            work = load_work(engine, held)
            assert work is not None
            shared += [work] if work.shared is not None else []
            assert finish(engine, held, execute(work, SolverOptions(), lambda _: False))


def test_it_beats_every_other_method(engine: Engine, settings: Settings) -> None:
    application_id, _ = submit(engine, settings, request())
    (work,) = run(engine)
    with reading(engine) as session:
        assert session.get_one(Application, application_id).state == ApplicationState.SUCCEEDED
    compared = results.comparison(engine, application_id)
    assert set(compared.methods) == {"own", "shared_optimum", "two_step", "empirical", "worst_case"}
    assert compared.judged == {
        name: pytest.approx(found.weighted_objective) for name, found in compared.methods.items()
    }
    assert not any(compared.unsolved.values())

    def weighted(method: str) -> float:
        short, long = (task["objective"] for task in compared.methods[method].per_task)
        return 2.0 * short + long

    others = {name: weighted(name) for name in ("two_step", "empirical", "worst_case")}
    assert weighted("own") < weighted("shared_optimum") <= min(others.values()) * (1 + 1e-6)
    assert work.shared is not None
    assert work.shared.method == min(others, key=lambda name: others[name])
    assert work.shared.total == pytest.approx(min(others.values()))
    stored = results.designs(engine, application_id).methods["shared_optimum"]
    assert stored.start == work.shared.method
    assert stored.convergence is not None
    # Each task goes on from where the joint program has its motion, so that none ends in a worse optimum.
    assert weighted("shared_optimum") <= stored.convergence[-1][1] * (1 + 1e-6)
    assert first_attempts(engine) == {"shared_optimum": {"given start"}} | {key: {"quintic"} for key in others}


def first_attempts(engine: Engine) -> dict[str, set[str]]:
    """What was tried first for the motions of each method."""
    found: dict[str, set[str]] = {}
    with reading(engine) as session:
        for result in session.scalars(select(Result).where(Result.stage.in_(MOTION_STAGES))):
            found.setdefault(result.method, set()).add(result.summary["attempts"][0]["name"])
    return found


def test_what_relaxing_the_current_limit_brings(engine: Engine, settings: Settings) -> None:
    """As the comparison says, against the same application with one percent more; weights included."""
    found = []
    for current in (3.0, 3.03):
        application_id, _ = submit(engine, settings, request(motor={"current_limit_A": current}))
        run(engine)
        found.append(results.comparison(engine, application_id))
    before, after = found
    for method in ("own", "shared_optimum", "two_step"):
        assert method in before.limits
    for method in ("own", "shared_optimum"):
        (cost,) = [cost for cost in before.limits[method] if cost.name == "current_limit_A"]
        assert (cost.value, cost.unit, cost.relax) == (3.0, "A", "raise")
        assert set(cost.tasks) == {0, 1}
        gained = before.methods[method].weighted_objective - after.methods[method].weighted_objective
        assert cost.gain_per_percent == pytest.approx(gained, rel=0.1)
        assert cost.gain_per_unit == pytest.approx(gained / 0.03, rel=0.1)
    of_design = [cost for cost in before.limits["shared_optimum"] if cost.of_the_design]
    assert of_design
    assert all(not cost.tasks for cost in of_design)
    assert not [cost for cost in before.limits["two_step"] if cost.name.startswith("bounds_mm")]


@pytest.mark.parametrize("status", ["Infeasible_Problem_Detected", "Solve_Succeeded"])
def test_a_solve_that_fails_or_ends_worse_leaves_the_best_design(
    engine: Engine, settings: Settings, monkeypatch: pytest.MonkeyPatch, status: str
) -> None:
    def worse(*arguments: Any, **_: Any) -> SharedOptimum:
        start = arguments[2]
        design = start.design * 1.01 if status == "Solve_Succeeded" else None
        return SharedOptimum(
            success=design is not None,
            status=status,
            design=design,
            reached=start.design,
            gear_ratio=np.full(6, 100.0),
            objective=1e9,
            iterations=5,
            solve_time=0.1,
            optimality=Optimality(1.0, 1.0),
            convergence=((0, 1e9),),
        )

    monkeypatch.setattr(find_shared_optimum, "solve_shared", worse)
    application_id, _ = submit(engine, settings, request())
    (work,) = run(engine)
    assert work.shared is not None
    with reading(engine) as session:
        assert session.get_one(Application, application_id).state == ApplicationState.SUCCEEDED
    kept = np.array(results.design(engine, application_id, "shared_optimum").design_mm)
    best = np.array(results.design(engine, application_id, work.shared.method).design_mm)
    np.testing.assert_allclose(kept, best, rtol=1e-12)


def test_a_task_that_cannot_be_done_spoils_nothing(engine: Engine, settings: Settings) -> None:
    """It is left out of the search, which is better than the other methods over the tasks that remain."""
    tasks = [task.model_dump(exclude_none=True) for task in request().tasks]  # type: ignore[union-attr]
    tasks.insert(1, {"name": "too fast", "start_rad": [1.0] * 6, "end_rad": HOME, "duration_s": 0.06})
    timed = [{"duration_s": 1.5} | task | {"payload_kg": 1.0} for task in tasks]  # slow, so that any design will do
    application_id, _ = submit(engine, settings, request(tasks=timed, objective={"kind": "energy"}))
    (work,) = run(engine)
    assert work.shared is not None
    assert work.shared.tasks == [0, 2]
    with reading(engine) as session:
        assert session.get_one(Application, application_id).state == ApplicationState.COMPLETED_WITH_FAILURES
    compared = results.comparison(engine, application_id)
    assert compared.tasks_compared == [0, 2]
    totals = {name: method.weighted_objective for name, method in compared.methods.items()}
    assert totals["own"] < totals["shared_optimum"]
    assert all(totals["shared_optimum"] <= total * (1 + 1e-6) for name, total in totals.items() if name != "own")


def test_the_worst_task_falls_and_its_share_is_told(engine: Engine, settings: Settings) -> None:
    """Against the sum over the same tasks: the longest time is shorter, and that task decides alone."""
    found = {}
    for kind in ("sum", "worst"):
        objective = {"kind": "time", "over_tasks": {"kind": kind}}
        application_id, _ = submit(engine, settings, request(objective=objective))
        run(engine)
        answer = results.comparison(engine, application_id)
        found[kind] = answer.methods["shared_optimum"]
        assert min(answer.judged, key=lambda name: (name == "own", answer.judged[name])) == "shared_optimum"
    three_times_the_worst = 3.0 * found["worst"].worst_objective  # weights 2 and 1
    assert answer.judged["shared_optimum"] == pytest.approx(three_times_the_worst)
    assert found["worst"].worst_task == 1
    assert found["worst"].worst_objective < found["sum"].worst_objective
    assert found["worst"].weighted_objective > found["sum"].weighted_objective
    (decides,) = results.designs(engine, application_id).methods["shared_optimum"].deciding_tasks or []
    assert (decides.name, decides.share) == ("long", pytest.approx(1.0, abs=1e-2))


@pytest.mark.parametrize(
    ("over_tasks", "field"),
    [({"kind": "mix"}, "share"), ({"kind": "sum", "share": 0.5}, "share"), ({"kind": "worst", "share": 0.5}, "share")],
)
def test_a_share_belongs_to_a_mix(engine: Engine, settings: Settings, over_tasks: dict[str, Any], field: str) -> None:
    with pytest.raises(InvalidInputError) as refused:
        submit(engine, settings, request(objective={"kind": "time", "over_tasks": over_tasks}))
    assert [error.field for error in refused.value.errors] == [f"objective.over_tasks.{field}"]
