"""Whether any motor fits the bounds and constraints at all, and if none does, what stands in the way."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from services.codesign.motor import constraint_limits, evaluate_motor
from services.codesign.motor_data import CONSTRAINTS, MotorData
from services.codesign.reconcile import project_design


@lru_cache(maxsize=64)
def motor_obstacle(motor: MotorData) -> str | None:
    """None when a feasible motor exists; otherwise what the nearest one found still breaks.

    The set is not convex and the search local, so three starts are tried: the middle of the bounds and both ends.
    """
    nearest, excess = motor.lower, np.inf
    for target in (np.sqrt(motor.lower * motor.upper), motor.lower, motor.upper):
        projection = project_design(target[None, :], motor)
        if projection.feasible:
            return None
        worst = float(_relative_excess(projection.design[0], motor).max())
        if worst < excess:
            nearest, excess = projection.design[0], worst
    return f"no motor within the bounds was found that meets every constraint; the nearest {_broken(nearest, motor)}"


def _relative_excess(design: np.ndarray, motor: MotorData) -> np.ndarray:
    """How far each constraint is beyond its limit, as a share of the limit, shape (6,)."""
    values = np.array(list(evaluate_motor(design, motor)[1].values()))
    low, high = constraint_limits(motor)
    excess: np.ndarray = np.maximum(np.where(np.isfinite(low), low - values, values - high), 0)
    return excess / np.abs(np.where(np.isfinite(low), low, high))


def _broken(design: np.ndarray, motor: MotorData) -> str:
    _, values = evaluate_motor(design, motor)
    low, high = constraint_limits(motor)
    k = int(np.argmax(_relative_excess(design, motor)))
    limit = f"at least {low[k]:.4g}" if np.isfinite(low[k]) else f"at most {high[k]:.4g}"
    return f"has {CONSTRAINTS[k]} = {values[CONSTRAINTS[k]]:.4g}, {limit}"
