"""Certificates from end to end: real solves through the queue, judged by a script that knows only their JSON."""

from __future__ import annotations

import importlib.util
import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from sqlalchemy import Engine

from services.codesign.instance import build_instance
from services.codesign.optimality import optimality
from services.codesign.problem import Problem, Transcription
from services.codesign.program import load_program
from services.codesign.robot import preset_wire
from services.codesign.solver import SolverOptions
from services.jobs import results, views
from services.jobs.claim import claim
from services.jobs.execute import execute
from services.jobs.finish import finish
from services.jobs.resolved import ResolvedApplication
from services.jobs.submit import submit
from services.jobs.work import load_work
from shared.contracts.application import ApplicationRequest
from shared.db.engine import make_engine
from shared.db.migrate import upgrade
from shared.domain import ApplicationState
from shared.settings import Settings
from tests.service.queue_actions import queued, state_of

ROOT = Path(__file__).parents[2]

AGREEMENT = 1e-6
"""Relative, of energies from two integrators with tolerances of 1e-9 and 1e-10."""

REPLAYED = 1e-7
"""Absolute (rad, rad/s), of states at the end from those two."""

PEAKS = 2e-3
"""Absolute, of shares of limits: the two look at the replay at different times."""

REQUESTS: dict[str, dict[str, Any]] = {
    "paper": {"transcription": {"degree": 1, "intervals": 20}},
    "moving": {"transcription": {"scheme": "legendre", "degree": 2, "intervals": 20, "control": "current"}},
    "accurate": {"transcription": {"accuracy": {"position_rad": 1e-3}}, "objective": {"kind": "energy"}},
    "rubbing": {
        "robot": preset_wire("ur5")
        | {
            "viscous_friction_Nms_rad": [2.0, 4.0, 3.0, 0.5, 0.5, 0.2],
            "coulomb_friction_Nm": [3.0, 5.0, 4.0, 1.0, 1.0, 0.5],
            "joint_speed_limit_rad_s": [None, 2.5, 2.5, None, None, None],
        },
        "transcription": {"degree": 1, "intervals": 20},
    },
}
TASK = {"start_rad": [0.4] * 6, "end_rad": [0.0] * 6, "payload_kg": 1.5, "duration_s": 0.9}
MOVING = {
    "start_rad": [0.5, -0.4, 0.8, 0.1, -0.6, 1.0],
    "end_rad": [-0.3, 0.6, -0.2, 0.9, 0.5, -1.0],
    "start_speed_rad_s": [0.3, -0.2, 0.4, 0.0, 0.5, -0.6],
    "end_speed_rad_s": [-0.4, 0.3, -0.2, 0.5, 0.1, 0.2],
    "payload_kg": 1.0,
}


@pytest.fixture(scope="module")
def checker() -> ModuleType:
    """The script, as people run it."""
    path = ROOT / "examples" / "check_certificate.py"
    spec = importlib.util.spec_from_file_location("check_certificate", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Engine, Settings]]:
    """A database of this module's own, for the solves are made once."""
    folder = tmp_path_factory.mktemp("certificates")
    url = f"sqlite:///{folder / 'armature.db'}"
    upgrade(url)
    engine = make_engine(url)
    yield engine, Settings(home=folder, database_url=url)
    engine.dispose()


@pytest.fixture(scope="module")
def finished(database: tuple[Engine, Settings]) -> Callable[[str], str]:
    """Ids of applications whose jobs have all been run."""
    engine, settings = database
    ids: dict[str, str] = {}

    def run(name: str) -> str:
        if name not in ids:
            task = {"name": "a move", **(MOVING if name == "moving" else TASK)}
            request = ApplicationRequest.model_validate({"name": name, "tasks": [task], **REQUESTS[name]})
            ids[name], _ = submit(engine, settings, request)
            drain(engine)
        return ids[name]

    return run


def drain(engine: Engine) -> None:
    """Run whatever is queued, and what follows from it."""
    while jobs := queued(engine):
        held = claim(engine, jobs[0], "worker", 600.0)
        assert held is not None
        work = load_work(engine, held)
        assert work is not None
        assert finish(engine, held, execute(work, SolverOptions(), lambda report: False))


@pytest.mark.parametrize(
    ("name", "method"), [("paper", "own"), ("moving", "two_step"), ("accurate", "two_step"), ("rubbing", "own")]
)
def test_a_script_that_knows_only_the_json_finds_the_same(
    name: str,
    method: str,
    finished: Callable[[str], str],
    database: tuple[Engine, Settings],
    checker: ModuleType,
) -> None:
    engine, _ = database
    answers = [
        results.inputs(engine, finished(name)).model_dump_json(),
        views.task(engine, finished(name), 0).model_dump_json(),
        results.trajectory(engine, finished(name), 0, method).model_dump_json(),
    ]
    figures = checker.check(*(json.loads(answer) for answer in answers))
    assert set(figures) >= {"replay_position_rad", "replay_speed_rad_s", "shaft_J", "current exceeded"}
    for figure, (here, there) in figures.items():
        if figure.startswith("replay"):
            assert here == pytest.approx(there, abs=REPLAYED, rel=1e-5), figure
        elif figure.endswith("exceeded"):
            assert here == pytest.approx(there, abs=PEAKS, rel=1e-2), figure
        else:
            scale = max(abs(value) for _, value in figures.values() if np.isfinite(value))
            assert here == pytest.approx(there, rel=AGREEMENT, abs=AGREEMENT * min(scale, 100.0)), figure


def test_peaks_are_those_between_the_points(finished: Callable[[str], str], database: tuple[Engine, Settings]) -> None:
    """The paper's motion keeps 3 A at its points and not between them: its result must say so."""
    result = views.task(database[0], finished("paper"), 0).own
    assert result is not None
    assert result.peaks_at_points is not None
    largest = max(*result.peaks["current_d"], *result.peaks["current_q"])
    assert max(*result.peaks_at_points["current_d"], *result.peaks_at_points["current_q"]) < 1 + 1e-6
    assert result.certificate.limits is not None
    assert largest - 1 == pytest.approx(result.certificate.limits["current"].between_points)
    assert largest > 1.1


@pytest.mark.parametrize("name", ["paper", "moving", "accurate"])
@pytest.mark.parametrize("method", ["own", "two_step"])
def test_kkt_residual_is_that_of_the_exported_point(
    name: str, method: str, finished: Callable[[str], str], database: tuple[Engine, Settings]
) -> None:
    engine, _ = database
    point = json.loads(results.solver_point(engine, finished(name), 0, method).model_dump_json())
    inputs = ResolvedApplication.model_validate_json(results.inputs(engine, finished(name)).model_dump_json())
    trajectory = results.trajectory(engine, finished(name), 0, method)
    problem = problem_of(inputs, point, None if method == "own" else np.array(trajectory.design_mm) * 1e-3)
    program = load_program(problem.robot, problem.layout, problem.transcription.intervals)
    instance = build_instance(problem, program)
    found = optimality(program, instance, *(np.array(point[key]) for key in ("x", "lam_x", "lam_g")))
    certificate = result_of(engine, finished(name), method)["certificate"]
    assert found.kkt_residual == pytest.approx(certificate["kkt_residual"], rel=1e-3, abs=1e-12)
    assert found.constraint_violation == pytest.approx(certificate["constraint_violation"], rel=1e-3, abs=1e-10)
    moved = optimality(program, instance, *(np.array(point[key]) * 1.001 for key in ("x", "lam_x", "lam_g")))
    assert moved.kkt_residual > 100 * found.kkt_residual


def problem_of(inputs: ResolvedApplication, point: dict[str, Any], design: np.ndarray | None) -> Problem:
    """The problem that an exported point solves."""
    problem = inputs.build_problem(0, design)
    transcription = Transcription(
        point["scheme"], point["degree"], point["intervals"], point["control"], widths=tuple(point["widths"])
    )
    return replace(problem, transcription=transcription)


def result_of(engine: Engine, application_id: str, method: str) -> dict[str, Any]:
    """A motion's result as JSON."""
    task = json.loads(views.task(engine, application_id, 0).model_dump_json())
    found: dict[str, Any] = task["own"] if method == "own" else task["methods"][method]
    return found


def test_a_transcription_as_it_is_may_miss_and_says_so(
    finished: Callable[[str], str], database: tuple[Engine, Settings]
) -> None:
    engine, _ = database
    assert state_of(engine, finished("paper"))[0] == ApplicationState.SUCCEEDED
    certificate = result_of(engine, finished("paper"), "own")["certificate"]
    assert certificate["as_requested"] is True
    assert certificate["within_tolerance"] is False
    assert certificate["replay_speed_rad_s"] > certificate["tolerance"]["speed_rad_s"]
    assert certificate["limits"]["current"]["at_points"] < 1e-5
    assert certificate["limits"]["current"]["between_points"] > 0.1
    assert certificate["limit_violation"] == max(
        value for check in certificate["limits"].values() for value in check.values()
    )


def test_an_accuracy_that_was_asked_for_is_kept(
    finished: Callable[[str], str], database: tuple[Engine, Settings]
) -> None:
    engine, _ = database
    for method in ("own", "two_step"):
        certificate = result_of(engine, finished("accurate"), method)["certificate"]
        assert certificate["as_requested"] is False
        assert certificate["within_tolerance"] is True
        assert certificate["replay_position_rad"] < 1e-3
        assert certificate["replay_speed_rad_s"] < 1e-2
        assert certificate["limit_violation"] < 1e-3
        assert certificate["refinements"][-1]["intervals"] == certificate["intervals"]
        assert {balance["closed"] for balance in certificate["energy_balance"].values()} == {True}


def test_an_accuracy_that_cannot_be_reached_is_a_failure_with_its_figures(
    database: tuple[Engine, Settings], monkeypatch: pytest.MonkeyPatch
) -> None:
    engine, settings = database
    monkeypatch.setattr("services.codesign.accuracy.MOST_REFINEMENTS", 0)
    accuracy = {"position_rad": 1e-8, "speed_rad_s": 1e-7, "limit": 1e-6}
    task = {"name": "a move", **TASK}
    request = {"name": "x", "tasks": [task], "transcription": {"accuracy": accuracy}, "objective": {"kind": "energy"}}
    application_id, _ = submit(engine, settings, ApplicationRequest.model_validate(request))
    drain(engine)
    assert state_of(engine, application_id)[0] == ApplicationState.FAILED
    task_result = views.task(engine, application_id, 0)
    assert task_result.own is None
    assert "accuracy asked for was not reached on 50 intervals of degree 3" in str(task_result.reason)


def test_hash_changes_with_every_input(finished: Callable[[str], str], database: tuple[Engine, Settings]) -> None:
    engine, _ = database
    hashes = [
        result_of(engine, finished(name), method)["certificate"]["input_hash"]
        for name in ("paper", "accurate")
        for method in ("own", "two_step")
    ]
    assert len(set(hashes)) == 4
    assert {len(value) for value in hashes} == {64}
