"""The method `catalogue`: another method's design, moved to sizes that can be had."""

from __future__ import annotations

from typing import Any

import numpy as np

from services.codesign.catalogue import snap
from services.jobs.design_wire import design_wire
from services.jobs.resolved import CATALOGUE, ResolvedApplication
from shared.contracts.application import MethodName


def snapped_designs(
    application: ResolvedApplication, source: MethodName, design: np.ndarray, gear_ratio: np.ndarray | None
) -> dict[str, dict[str, Any]]:
    """By method, what is stored: nothing without a catalogue, or when a joint has no motor in it that can be built.

    Parameters
    ----------
    source
        The method that the design, shape (n, 7) [m], and free gear ratios, shape (n,), are of.
    """
    catalogue, motor = application.catalogue, application.build_motor()
    found = None if catalogue is None else snap(design, catalogue, motor)
    if found is None:
        return {}
    content = design_wire(np.array([entry.dimensions for entry in found]), motor, gear_ratio) | {
        "source": source,
        "distance": sum(entry.distance for entry in found),
        "entries": names if None not in (names := [entry.name for entry in found]) else None,
    }
    return {CATALOGUE: content}
