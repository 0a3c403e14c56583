"""Tasks as random samples: what is drawn, what is refused, and what comes back."""

from __future__ import annotations

import statistics
from typing import Any

import numpy as np
import pytest
from sqlalchemy import Engine

from services.codesign.robot import Robot
from services.jobs import overview, results
from services.jobs.resolve import resolve
from services.jobs.resolved import ResolvedApplication
from services.jobs.submit import submit
from shared.contracts.application import ApplicationRequest
from shared.contracts.errors import InvalidInputError
from shared.settings import Settings
from tests.service.requests import HOME, POSE
from tests.service.test_shared_optimum import QUICK, run

UR5 = Robot.preset("ur5")
SCATTER = {"payload_kg": 0.5, "position_rad": 0.1, "samples": 10, "seed": 7}


@pytest.fixture
def database_url(tmp_path: Any) -> str:
    """SQLite alone: what is tested here is not the database."""
    return f"sqlite:///{tmp_path / 'armature.db'}"


def request(scatter: dict[str, Any], **changes: Any) -> ApplicationRequest:
    tasks = [
        {"name": "light", "start_rad": POSE, "end_rad": HOME, "payload_kg": 1.0},
        {"name": "heavy", "start_rad": [0.5] * 6, "end_rad": HOME, "payload_kg": 3.0, "weight": 3.0},
    ]
    return ApplicationRequest(**{"name": "scattered", "tasks": tasks, "scatter": scatter, **changes})


def resolved(scatter: dict[str, Any], most: int = 1000, **changes: Any) -> ResolvedApplication:
    return resolve(request(scatter, **changes), lambda _: None, most)


def drawn(application: ResolvedApplication) -> np.ndarray:
    """Samples as rows: payload, start, end."""
    return np.array([[task.payload_kg, *task.start_rad, *task.end_rad] for task in application.tasks])


def test_the_same_seed_draws_the_same_samples() -> None:
    np.testing.assert_array_equal(drawn(resolved(SCATTER)), drawn(resolved(SCATTER)))
    assert (drawn(resolved(SCATTER)) != drawn(resolved(SCATTER | {"seed": 8}))).all(axis=1).any()


def test_another_task_changes_none_of_the_others() -> None:
    alone = resolved(SCATTER, tasks=[{"name": "light", "start_rad": POSE, "end_rad": HOME, "payload_kg": 1.0}])
    np.testing.assert_array_equal(drawn(alone), drawn(resolved(SCATTER))[:10])


def test_samples_fill_the_box_evenly() -> None:
    """A Latin hypercube: of ten samples one lies in each tenth, in every direction."""
    application = resolved(SCATTER)
    centre = np.array([1.0, *POSE, *HOME])
    width = np.array([0.5, *[0.1] * 12])
    shares = (drawn(application)[:10] - centre) / width / 2 + 0.5
    assert (np.sort(np.floor(shares * 10), axis=0) == np.arange(10)[:, None]).all()
    assert [task.name for task in application.tasks[:2]] == ["light, sample 1", "light, sample 2"]
    assert application.given_tasks == ["light", "heavy"]
    assert [application.given_task_of(k) for k in (0, 9, 10, 19)] == [0, 0, 1, 1]


def test_a_normal_distribution_has_its_standard_deviation() -> None:
    rows = drawn(resolved(SCATTER | {"distribution": "normal", "samples": 400, "payload_kg": 0.2}, 2000))[:400]
    np.testing.assert_allclose(rows.std(axis=0), [0.2, *[0.1] * 12], rtol=0.05)
    assert np.abs(rows[:, 1] - POSE[0]).max() > 0.2


def test_samples_share_their_tasks_weight() -> None:
    weights = [task.weight for task in resolved(SCATTER).tasks]
    assert weights == pytest.approx([0.1] * 10 + [0.3] * 10)


def test_samples_stay_possible() -> None:
    """No payload below nothing, no pose out of a joint's range."""
    edge = UR5.joint_upper - 0.01
    tasks = [{"start_rad": edge.tolist(), "end_rad": HOME, "payload_kg": 0.1}]
    rows = drawn(resolved(SCATTER | {"position_rad": 0.5}, tasks=tasks))
    assert rows[:, 0].min() == 0.0
    assert (rows[:, 1:7] <= UR5.joint_upper).all()
    assert (rows[:, 1:7] == UR5.joint_upper).any()


@pytest.mark.parametrize(
    ("changes", "field", "words"),
    [
        ({"most": 19}, "scatter.samples", "2 tasks of so many samples each: at most 19 tasks"),
        ({"empirical_task": "light", "compare": ["empirical"]}, "empirical_task", "'light, sample 1'"),
    ],
)
def test_refused(changes: dict[str, Any], field: str, words: str) -> None:
    with pytest.raises(InvalidInputError) as refused:
        resolved(SCATTER, **changes)
    (error,) = refused.value.errors
    assert error.field == field
    assert words in error.limit


def test_a_robust_design_through_the_jobs(engine: Engine, settings: Settings) -> None:
    """Its expected value is below that of every other method; and the spread is that of the samples' own motions."""
    scatter = {"payload_kg": 2.0, "samples": 3, "seed": 1}
    wanted = request(scatter, transcription=QUICK, method="shared_optimum", compare=["worst_case"], worst_case_task=5)
    application_id, _ = submit(engine, settings, wanted)
    run(engine)
    found = results.comparison(engine, application_id)
    expected = {name: method.weighted_objective for name, method in found.methods.items()}
    assert expected["own"] < expected["shared_optimum"] < min(expected["two_step"], expected["worst_case"])
    light, heavy = found.scattered
    assert (light.name, light.samples, heavy.name, heavy.samples) == ("light", 3, "heavy", 3)
    for name, method in found.methods.items():
        of_heavy = [task["objective"] for task in method.per_task[3:]]
        spread = heavy.methods[name]
        assert spread.mean == pytest.approx(sum(of_heavy) / 3)
        assert spread.largest == max(of_heavy)
        assert spread.standard_deviation == pytest.approx(statistics.stdev(of_heavy))
        assert expected[name] == pytest.approx(light.methods[name].mean + 3 * spread.mean)
    meaning = overview.resolved(engine, application_id)
    assert meaning.scatter is not None
    assert meaning.scatter.samples == 3
    assert meaning.given_tasks == ["light", "heavy"]
