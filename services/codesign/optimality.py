"""How nearly a point is optimal, from the program's own functions: nothing is copied from the solver's log.

With CasADi's signs: a multiplier is positive where an upper bound holds the point back, negative for a lower one,
and ``grad f + J' lam_g + lam_x = 0`` at an optimum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from services.codesign.instance import Instance
from services.codesign.program import Program
from services.codesign.shared_program import SharedProgram

MULTIPLIER_SIZE = 100.0
"""Mean multiplier above which residuals are taken relative to it: s_max of Waechter & Biegler 2006, eq. (6)."""


@dataclass(frozen=True)
class Optimality:
    """Residuals of the first-order conditions, in the program's scaled units."""

    kkt_residual: float  # largest of stationarity and complementarity, over s_d
    constraint_violation: float  # largest, constraints and bounds; 1 is about one limit


def optimality(
    program: Program | SharedProgram, instance: Instance, x: np.ndarray, lam_x: np.ndarray, lam_g: np.ndarray
) -> Optimality:
    """Evaluate the first-order conditions at a point with its multipliers.

    Multipliers of pinned variables (equal bounds: a given design, the end state) count like the others; minus
    `lam_x` is there the slope of the optimum in the pinned value.
    """
    gradient = program.grad_f(x, instance.parameters)[1].full().ravel()
    values, jacobian = program.jac_g(x, instance.parameters)
    g = values.full().ravel()
    slope = gradient + (jacobian.T @ lam_g).full().ravel()
    complementarity = max(
        _complementarity(x, lam_x, instance.lower_x, instance.upper_x),
        _complementarity(g, lam_g, instance.lower_g, instance.upper_g),
    )
    mean = float(np.abs(np.concatenate([lam_x, lam_g])).mean())
    scale = max(MULTIPLIER_SIZE, mean) / MULTIPLIER_SIZE
    return Optimality(
        kkt_residual=max(float(np.abs(slope + lam_x).max()), complementarity) / scale,
        constraint_violation=max(
            _outside(x, instance.lower_x, instance.upper_x), _outside(g, instance.lower_g, instance.upper_g)
        ),
    )


def _outside(values: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> float:
    return float(np.maximum(np.maximum(lower - values, values - upper), 0).max())


def _complementarity(values: np.ndarray, lam: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> float:
    """Largest |multiplier x distance to its bound|; a multiplier of a bound that is not there counts in full."""
    free = lower != upper
    above = np.where(np.isfinite(upper), np.abs(upper - values), 1.0)
    below = np.where(np.isfinite(lower), np.abs(values - lower), 1.0)
    products = np.where(lam > 0, lam * above, -lam * below)
    return float(products[free].max(initial=0.0))
