"""Motors that can be bought: a design moved to a catalogue's entries, or to sizes that come in steps.

A joint's motor becomes the nearest feasible one, in the relative distance of Problem 2. What that costs in the motions
is found by solving them again (the comparison), not here.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from services.codesign.motor_data import DIMENSIONS, MotorData
from services.codesign.reconcile import violation

FEASIBLE = 1e-6
"""Relative violation of a limit that rounding may leave."""

REACH = 3
"""Steps to either side of a length that are tried, at most; one at first."""


@dataclass(frozen=True)
class CatalogueMotor:
    """A motor with a name."""

    name: str
    dimensions: np.ndarray  # (7,) m


@dataclass(frozen=True)
class Catalogue:
    """Motors to choose from, or, without any, steps in which lengths come."""

    motors: tuple[CatalogueMotor, ...] = ()
    steps: Mapping[str, float] | None = None  # m, by length; the others stay as they are


@dataclass(frozen=True)
class Snapped:
    """A joint's motor from a catalogue."""

    dimensions: np.ndarray  # (7,) m
    distance: float  # sum of squared relative differences to the motor asked for
    name: str | None  # of a catalogue's motor


def snap(design: np.ndarray, catalogue: Catalogue, motor: MotorData) -> list[Snapped] | None:
    """The nearest feasible motor for each row of a design, shape (n, 7) [m]; None when a joint has none."""
    snapped = [snap_motor(row, catalogue, motor) for row in design]
    found = [entry for entry in snapped if entry is not None]
    return found if len(found) == len(snapped) else None


def snap_motor(target: np.ndarray, catalogue: Catalogue, motor: MotorData) -> Snapped | None:
    """The nearest feasible motor to one of shape (7,) [m]."""
    if catalogue.motors:
        entries = [Snapped(m.dimensions, distance(m.dimensions, target), m.name) for m in catalogue.motors]
        return _nearest(entries, motor)
    for reach in range(1, REACH + 1):
        found = _nearest(_on_steps(target, catalogue.steps or {}, motor, reach), motor)
        if found is not None:
            return found
    return None


def distance(dimensions: np.ndarray, target: np.ndarray) -> float:
    """Problem 2's objective: sum of squared relative differences."""
    return float(((dimensions / target - 1) ** 2).sum())


def _nearest(entries: Sequence[Snapped], motor: MotorData) -> Snapped | None:
    by_distance = sorted(entries, key=lambda entry: entry.distance)
    return next((entry for entry in by_distance if violation(entry.dimensions, motor) <= FEASIBLE), None)


def _on_steps(target: np.ndarray, steps: Mapping[str, float], motor: MotorData, reach: int) -> list[Snapped]:
    """Motors with every stepped length on a multiple within `reach` steps of the target and within its bounds."""
    choices = []
    for length, name in zip(target, DIMENSIONS, strict=True):
        if name not in steps:
            choices.append(np.array([length]))
            continue
        step, (low, high) = steps[name], motor.bounds[name]
        below = np.floor(length / step + FEASIBLE)
        multiples = step * (below + np.arange(1 - reach, reach + 1))
        choices.append(multiples[(multiples >= low * (1 - FEASIBLE)) & (multiples <= high * (1 + FEASIBLE))])
    grid = [np.array(lengths) for lengths in itertools.product(*choices)]
    return [Snapped(dimensions, distance(dimensions, target), None) for dimensions in grid]
