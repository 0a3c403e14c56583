"""Every example means something, and what is said about it is true."""

from __future__ import annotations

from pathlib import Path

import pytest
from sqlalchemy import Engine

from armature.application_file import read_application, read_sweep
from armature.cli.reference import SUFFIX, reference_beside
from services.jobs.resolve import resolve
from services.jobs.resolved import ResolvedApplication
from services.jobs.sweeps import submit_sweep, sweep_status
from shared.contracts.application import ApplicationRequest
from shared.contracts.sweeps import SweepRequest
from shared.settings import Settings

FILES = sorted((Path(__file__).parents[2] / "examples").glob("*.yaml"))
SWEEPS = [path for path in FILES if "\naxes:" in path.read_text(encoding="utf-8")]
EXAMPLES = [path for path in FILES if path not in SWEEPS]
MOST_POINTS = 20
PAPERS_TRANSCRIPTION = {"scheme": "radau", "degree": 1, "intervals": 50, "control": "voltage"}


def resolved(path: Path) -> ResolvedApplication:
    """As the server reads it."""
    return resolve(ApplicationRequest.model_validate(read_application(path)), lambda _: None, max_tasks=100)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_it_is_accepted(path: Path) -> None:
    assert resolved(path).tasks


@pytest.mark.parametrize("path", SWEEPS, ids=lambda path: path.stem)
def test_a_sweep_is_accepted(path: Path, engine: Engine, settings: Settings) -> None:
    request = SweepRequest.model_validate(read_sweep(path))
    sweep_id, new = submit_sweep(engine, settings.model_copy(update={"max_sweep_points": MOST_POINTS}), request)
    assert new
    assert {point.reason for point in sweep_status(engine, sweep_id).points} == {None}


@pytest.mark.parametrize("name", ["pick_and_place", "pick_and_place_energy"])
def test_the_papers_examples_are_the_papers(name: str) -> None:
    (path,) = (path for path in EXAMPLES if path.stem == name)
    request = read_application(path)
    assert request["transcription"] == PAPERS_TRANSCRIPTION
    application = resolved(path)
    assert len(application.tasks) == 25
    assert application.methods == ["two_step", "empirical", "worst_case"]
    assert application.tasks[application.empirical_task or 0].name == "stroke 0.6 rad, 2 kg"
    assert application.tasks[application.worst_case_task or 0].name == "stroke 1 rad, 4 kg"


def test_names_in_references_are_those_of_the_application() -> None:
    """A reference whose tasks have other names would be compared with nothing, in silence."""
    beside = [(path, reference) for path in EXAMPLES if (reference := reference_beside(path)) is not None]
    assert len(beside) == len(list(EXAMPLES[0].parent.glob(f"*{SUFFIX}"))) == 3
    for path, reference in beside:
        application = resolved(path)
        assert set(reference.tasks) <= {task.name for task in application.tasks}
        assert set(reference.totals) <= {"own", *application.methods}
        assert set(reference.explanations) <= set(reference.totals)
        assert reference.unit == {"time": "s", "energy": "V2 s"}[application.objective.kind]
