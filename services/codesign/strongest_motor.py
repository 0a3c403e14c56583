"""The motor with the most torque per ampere within the bounds: a starting design, and the yardstick of a diagnosis."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from services.codesign.instance import TYPICAL_DESIGN, TYPICAL_FLUX_LINKAGE
from services.codesign.motor import (
    constraint_limits,
    design_constraints,
    evaluate_motor,
    motor_parameters,
    motor_torque,
)
from services.codesign.motor_data import COEFFICIENTS, DIMENSIONS, MotorData
from services.codesign.reconcile import feasible_design

TOLERANCE = 1e-8


@lru_cache(maxsize=1)
def _maximiser() -> ca.Function:
    scaled, coefficients = ca.SX.sym("design", len(DIMENSIONS)), ca.SX.sym("coefficients", len(COEFFICIENTS))
    design = scaled * TYPICAL_DESIGN
    nlp = {
        "x": scaled,
        "p": coefficients,
        "f": -motor_parameters(design, coefficients).flux_linkage / TYPICAL_FLUX_LINKAGE,
        "g": design_constraints(design, coefficients),
    }
    ipopt: dict[str, Any] = {
        "tol": TOLERANCE,
        "print_level": 0,
        "sb": "yes",
        "max_iter": 500,
        "bound_relax_factor": 0.0,
    }
    options: dict[str, Any] = {"ipopt": ipopt, "print_time": False}
    return ca.nlpsol("strongest", "ipopt", nlp, options)


def strongest_motor(motor: MotorData) -> np.ndarray:
    """Design, shape (7,) [m], of the largest flux linkage within the bounds and (2b)-(3c); torque is proportional.

    The best of two starts (a local solver): the feasible design nearest to the middle, and the upper bounds.

    Raises
    ------
    ValueError
        When no design satisfies the bounds and constraints.
    """
    solver, (low, high) = _maximiser(), constraint_limits(motor)
    best, strongest = feasible_design(motor), -np.inf
    for start in (best, motor.upper):
        result = solver(
            x0=start / TYPICAL_DESIGN,
            p=motor.coefficients(),
            lbx=motor.lower / TYPICAL_DESIGN,
            ubx=motor.upper / TYPICAL_DESIGN,
            lbg=low,
            ubg=high,
        )
        if solver.stats()["success"] and -float(result["f"]) > strongest:
            strongest = -float(result["f"])
            best = np.clip(result["x"].full().ravel() * TYPICAL_DESIGN, motor.lower, motor.upper)
    return best


def strongest_torque(motor: MotorData) -> float:
    """Largest torque [N m] on the rotor's side that any motor within the bounds gives at the current limit."""
    parameters, _ = evaluate_motor(strongest_motor(motor), motor)
    return float(motor_torque(motor.current_limit, parameters, motor.pole_pairs))
