"""Requests made up from the OpenAPI document, and sequences of them, for longer than `make test` has."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from sqlalchemy import Engine

from shared.settings import Settings
from tests.faults.conftest import Measured
from tests.service.test_interface import ask_anything

FOR_LONGER = """
seed = 1
max-time = 75
"""


@pytest.mark.true_length
def test_whatever_is_asked_for_longer(settings: Settings, engine: Engine, tmp_path: Path, measured: Measured) -> None:
    report = ask_anything(settings, engine, tmp_path, FOR_LONGER)
    cases = re.search(r"([\d,]+) generated", report)
    assert cases is not None, report
    measured(f"{cases[1]} requests, no 5xx and no answer that the document does not know")
