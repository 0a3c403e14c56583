"""Hypothesis for the numerics: the same examples every time, and no clock, for a machine may be busy."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("numerics", deadline=None, derandomize=True, database=None)
settings.load_profile("numerics")
