"""Derivatives of a program gathered from kernels, against those of the whole program."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np


def assert_derivatives_of_the_whole(program: Any, x: np.ndarray, p: Any, lam_g: np.ndarray, rounding: float) -> None:
    """Gathered from kernels here, found by differentiating `program.nlp` there; within `rounding` of the largest entry.

    Parameters
    ----------
    program
        With `nlp`, `grad_f`, `jac_g` and `hess_lag`.
    x, p
        Point and parameters.
    lam_g
        Multipliers of the constraints.
    rounding
        Relative to the largest entry: the same numbers, added up in another order.
    """
    lam_f = 0.7
    X, P, LF, LG = (ca.MX.sym(s, k) for s, k in (("x", len(x)), ("p", len(p)), ("lf", 1), ("lg", len(lam_g))))
    f, g = program.nlp(X, P)
    hessian, _ = ca.hessian(LF * f + ca.dot(LG, g), X)
    whole = ca.Function("whole", [X, P, LF, LG], [f, g, ca.gradient(f, X), ca.jacobian(g, X), ca.triu(hessian)])
    f_found, gradient = program.grad_f(x, p)
    g_found, jacobian = program.jac_g(x, p)
    found = [f_found, g_found, gradient, jacobian, program.hess_lag(x, p, lam_f, lam_g)]
    for a, b in zip(found, whole(x, p, lam_f, lam_g), strict=True):
        assert np.abs(a.full() - b.full()).max() <= rounding * np.abs(b.full()).max()
