"""From n designs to one: the mean and its projection on the feasible set  (Problem 2; MODEL section 6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from services.codesign.motor import constraint_limits, design_constraints, evaluate_motor
from services.codesign.motor_data import COEFFICIENTS, DIMENSIONS, MotorData

TOLERANCE = 1e-9
"""IPOPT tolerance of the projection: seven variables, so the last digits are free."""


@dataclass(frozen=True)
class Projection:
    """A feasible design and how far it lies from the one asked for."""

    design: np.ndarray  # (n, 7) m
    distance: float  # Problem 2's objective: sum of squared relative differences
    feasible: bool
    status: str  # IPOPT's, of the first motor that failed, or Solve_Succeeded


def mean_design(designs: Sequence[np.ndarray], weights: Sequence[float] | None = None) -> np.ndarray:
    """Weighted mean of designs, each (n, 7) m; equal weights, as in the paper, when None."""
    if len(designs) == 0:
        raise ValueError("no design to average: no task was solved")
    mean: np.ndarray = np.average(np.stack(designs), axis=0, weights=weights)
    return mean


def project_design(target: np.ndarray, motor: MotorData) -> Projection:
    """Problem 2: the feasible design nearest to `target`, shape (n, 7) [m], in relative distance.

    The motors do not meet in the constraints, so each is projected by itself.
    """
    results = [_project_motor(row, motor) for row in target]
    failed = [status for *_, ok, status in results if not ok]
    return Projection(
        design=np.array([design for design, *_ in results]),
        distance=float(sum(distance for _, distance, *_ in results)),
        feasible=not failed,
        status=failed[0] if failed else "Solve_Succeeded",
    )


@lru_cache(maxsize=64)
def feasible_design(motor: MotorData) -> np.ndarray:
    """A design inside the feasible set for one motor, shape (7,) m: the one nearest to the geometric mid-bounds.

    Raises
    ------
    ValueError
        When no design satisfies the bounds and (2b)-(3c).
    """
    projection = project_design(np.sqrt(motor.lower * motor.upper)[None, :], motor)
    if not projection.feasible:
        raise ValueError("no motor satisfies the design bounds and constraints (2) and (3c) together")
    design: np.ndarray = projection.design[0]
    design.setflags(write=False)  # it is kept, and handed out again
    return design


def violation(design: np.ndarray, motor: MotorData) -> float:
    """Largest relative violation of the bounds and constraints by a design of shape (7,) m; 0 inside."""
    values = np.array(list(evaluate_motor(design, motor)[1].values()))
    low, high = constraint_limits(motor)
    scale = np.abs(np.where(np.isfinite(low), low, high))
    outside = np.maximum(np.maximum(low - values, values - high) / scale, 0)
    beyond = np.maximum(np.maximum(1 - design / motor.lower, design / motor.upper - 1), 0)
    return float(max(outside.max(), beyond.max()))


@lru_cache(maxsize=1)
def _projector() -> ca.Function:
    """Problem 2 for one motor, in the ratio of each length to its target."""
    ratio, target = ca.SX.sym("ratio", len(DIMENSIONS)), ca.SX.sym("target", len(DIMENSIONS))
    coefficients = ca.SX.sym("coefficients", len(COEFFICIENTS))
    nlp = {
        "x": ratio,
        "p": ca.vertcat(target, coefficients),
        "f": ca.sumsqr(ratio - 1),
        "g": design_constraints(ratio * target, coefficients),
    }
    ipopt: dict[str, Any] = {
        "tol": TOLERANCE,
        "print_level": 0,
        "sb": "yes",
        "max_iter": 500,
        "bound_relax_factor": 0.0,
    }
    options: dict[str, Any] = {"ipopt": ipopt, "print_time": False}
    return ca.nlpsol("project", "ipopt", nlp, options)


def _project_motor(target: np.ndarray, motor: MotorData) -> tuple[np.ndarray, float, bool, str]:
    if violation(target, motor) <= 0:
        return target, 0.0, True, "Solve_Succeeded"
    solver = _projector()
    low, high = constraint_limits(motor)
    result = solver(
        x0=np.clip(target, motor.lower, motor.upper) / target,
        p=np.concatenate([target, motor.coefficients()]),
        lbx=motor.lower / target,
        ubx=motor.upper / target,
        lbg=low,
        ubg=high,
    )
    stats = solver.stats()
    design = np.clip(result["x"].full().ravel() * target, motor.lower, motor.upper)
    return design, float(result["f"]), bool(stats["success"]), str(stats["return_status"])
