"""What people may say about the transcription, and what it is understood as."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from services.codesign.problem import FIRST, Accuracy, Transcription
from services.jobs.resolve import resolve
from services.jobs.resolved import ResolvedApplication
from shared.contracts.application import AccuracyRequest, ApplicationRequest
from tests.service.requests import body


def resolved(transcription: dict[str, Any] | None) -> ResolvedApplication:
    """As stored and read back."""
    given = body() if transcription is None else body(transcription=transcription)
    stored = resolve(ApplicationRequest.model_validate(given), lambda _: None, max_tasks=10).model_dump_json()
    return ResolvedApplication.model_validate_json(stored)


@pytest.mark.parametrize("given", [None, {}, {"accuracy": {}}], ids=["left out", "empty", "accuracy without figures"])
def test_the_default_is_the_default_accuracy(given: dict[str, Any] | None) -> None:
    application = resolved(given)
    assert application.accuracy == Accuracy(position=1e-3, speed=1e-2, limit=1e-3)
    assert application.build_problem(0).transcription == FIRST


def test_an_accuracy_is_taken_over() -> None:
    asked = {"position_rad": 1e-4, "speed_rad_s": 1e-3, "limit": 5e-3}
    assert resolved({"accuracy": asked}).accuracy == Accuracy(1e-4, 1e-3, 5e-3)
    defaults, contract = Accuracy(), AccuracyRequest()
    assert (defaults.position, defaults.speed, defaults.limit) == (
        contract.position_rad,
        contract.speed_rad_s,
        contract.limit,
    )


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"preset": "paper"}, Transcription("radau", 1, 50, "voltage")),
        ({"intervals": 20}, Transcription("radau", 1, 20, "voltage")),
        ({"scheme": "legendre", "degree": 2, "control": "current"}, Transcription("legendre", 2, 50, "current")),
    ],
    ids=["preset", "in part", "another"],
)
def test_a_transcription_is_taken_as_it_is(given: dict[str, Any], expected: Transcription) -> None:
    application = resolved(given)
    assert application.accuracy is None
    assert application.build_problem(0).transcription == expected


@pytest.mark.parametrize(
    "given",
    [{"accuracy": {}, "degree": 2}, {"preset": "paper", "intervals": 20}, {"preset": "paper", "accuracy": {}}],
    ids=["accuracy and degree", "preset and intervals", "preset and accuracy"],
)
def test_two_forms_at_once_are_refused(given: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match="must be an accuracy, a preset, or a scheme") as refusal:
        ApplicationRequest.model_validate(body(transcription=given))
    assert refusal.value.errors()[0]["loc"] == ("transcription",)
