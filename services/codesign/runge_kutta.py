"""Variable steps of order 8 over an interval: Dormand and Prince's pair with its dense output.

Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I (1993), section II.5 and II.6: DOP853. The
tableau is scipy's; a step is one CasADi function, so that it is compiled with the plant. An explicit method: an
interval that it cannot cross in `MOST_STEPS` is stiff and left to another.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import DOP853

Expression = Any

MOST_STEPS = 300
"""Tries in one interval. Motions of the paper take 10 to 40, with voltages that reverse many currents up to 150."""

FIRST_STEP = 0.2
LEAST_STEP = 1e-9
"""Shares of an interval."""

SAFETY, SHRINK, GROW = 0.9, 0.2, 8.0
"""Of the step that would just do, and the most that one step differs from the one before."""

EXPONENT = -1 / 8
TINY = 1e-12

DENSE = len(DOP853.D) + 3
"""Coefficients of the dense output, a polynomial of degree 7 in each step."""


def step_function(slopes: ca.Function, tolerance: float, quadrature_tolerance: float) -> ca.Function:
    """One step: (share, state, rates there, totals, step, parameters) -> (state, rates, totals, error, dense).

    `slopes` is (share, state, parameters) -> (rates, rates of quadratures). States are kept to `tolerance`,
    absolute and relative, quadratures to theirs; the step will do where `error` is at most 1. `dense` has a column
    for each coefficient of the states' polynomial.
    """
    states, quadratures = slopes.size1_out(0), slopes.size1_out(1)
    t, h = ca.MX.sym("share"), ca.MX.sym("step")
    y, totals = ca.MX.sym("state", states), ca.MX.sym("totals", quadratures)
    given_rates, p = ca.MX.sym("rates", states + quadratures), ca.MX.sym("parameters", slopes.size1_in(2))

    K = [given_rates]

    def after(weights: np.ndarray) -> Expression:
        """Sum of weights times the stages so far."""
        used = [(w, k) for w, k in zip(weights, K, strict=False) if w]
        return combination(tuple(w for w, _ in used), states + quadratures)(*(k for _, k in used))

    def stage(c: float, increment: Expression) -> Expression:
        return ca.vertcat(*slopes(t + c * h, y + h * increment[:states], p))

    for a, c in zip(DOP853.A[1:], DOP853.C[1:], strict=True):
        K.append(stage(c, after(a)))
    change = after(DOP853.B)
    K.append(stage(1.0, change))
    error5, error3 = after(DOP853.E5), after(DOP853.E3)
    for a, c in zip(DOP853.A_EXTRA, DOP853.C_EXTRA, strict=True):
        K.append(stage(c, after(a)))

    end, end_totals = y + h * change[:states], totals + h * change[states:]
    scale = ca.vertcat(
        tolerance * (1 + ca.fmax(ca.fabs(y), ca.fabs(end))), quadrature_tolerance * (1 + ca.fabs(end_totals))
    )
    fifth, third = ca.sumsqr(error5 / scale), ca.sumsqr(error3 / scale)
    weighted = fifth + 0.01 * third
    error = ca.if_else(weighted == 0, 0, h * fifth / ca.sqrt((states + quadratures) * weighted))

    rates, end_rates, delta = K[0][:states], K[12][:states], h * change[:states]
    dense = [delta, h * rates - delta, 2 * delta - h * (rates + end_rates)]
    dense += [h * after(row)[:states] for row in DOP853.D]
    return ca.Function(
        "step",
        [t, y, given_rates, totals, h, p],
        [end, K[12], end_totals, error, ca.horzcat(*dense)],
        {"cse": True},
    )


def combination(weights: tuple[float, ...], size: int) -> ca.Function:
    """Weighted sum of vectors as a function of scalars: half the time of the matrix product."""
    vectors = [ca.SX.sym(f"k{j}", size) for j in range(len(weights))]
    total: Expression = sum(w * k for w, k in zip(weights, vectors, strict=True))
    return ca.Function(f"combination_{len(weights)}", vectors, [total])


@dataclass(frozen=True)
class Steps:
    """Steps across an interval, each with its polynomial."""

    starts: np.ndarray  # (k,) shares
    origins: np.ndarray  # (k, states) at those
    polynomials: np.ndarray  # (k, `DENSE`, states)
    end: np.ndarray  # (states,)
    totals: np.ndarray  # (quadratures,) at the end
    next_step: float  # that would do after it

    @property
    def ends(self) -> np.ndarray:
        """Shares where steps begin, and 1, (k + 1,)."""
        return np.append(self.starts, 1.0)

    def at(self, share: np.ndarray) -> np.ndarray:
        """States at shares of the interval, (m,) -> (m, states)."""
        step = np.searchsorted(self.starts, share, side="right") - 1
        s = (share - self.starts[step]) / np.diff(self.ends)[step]
        states: np.ndarray = np.einsum("mk,mkx->mx", dense_basis(s), self.polynomials[step]) + self.origins[step]
        return states

    def within(self, share: np.ndarray) -> np.ndarray:
        """States at shares of every step, (m,) -> (k, m, states)."""
        states: np.ndarray = dense_basis(share) @ self.polynomials + self.origins[:, None, :]
        return states


def dense_basis(share: np.ndarray) -> np.ndarray:
    """Polynomials of a step that the coefficients of its dense output belong to: s, s (1 - s), s^2 (1 - s), ..."""
    factors = np.where(np.arange(DENSE) % 2 == 0, share[:, None], 1 - share[:, None])
    basis: np.ndarray = np.cumprod(factors, axis=1)
    return basis


class Stepper:
    """Crosses intervals with a compiled step, whose arguments and results stay in place between calls.

    Not for several threads at once.
    """

    def __init__(self, slopes: ca.Function, step: ca.Function) -> None:
        self._in = [np.zeros(step.size1_in(k)) for k in range(step.n_in())]
        self._out = [np.zeros(step.nnz_out(k)) for k in range(step.n_out())]
        t, y, rates, _, _, p = self._in
        states = len(y)
        self._buffers = (
            _buffer(slopes, [t, y, p], [rates[:states], rates[states:]]),
            _buffer(step, self._in, self._out),
        )

    def cross(
        self, state: np.ndarray, totals: np.ndarray, parameters: np.ndarray, step: float = FIRST_STEP
    ) -> Steps | None:
        """From share 0 to 1; None when `MOST_STEPS` do not suffice, or no step is small enough.

        `state` and `totals` are those at the start; `step` is tried first. Nothing is remembered between calls.
        """
        (_, evaluate_slopes), (_, evaluate_step) = self._buffers
        t, y, rates, running, h, p = self._in
        end, end_rates, end_totals, error, dense = self._out
        t[0], y[:], running[:], p[:] = 0.0, state, totals, parameters
        evaluate_slopes()
        taken = []
        for _ in range(MOST_STEPS):
            start = float(t[0])
            last = step >= 1 - start
            width = 1 - start if last else step
            h[0] = width
            evaluate_step()
            wrong = float(error[0])
            if wrong <= 1:
                taken.append((start, y.copy(), dense.copy()))
                step = width * min(GROW, max(SHRINK, SAFETY * max(wrong, TINY) ** EXPONENT))
                if last:
                    starts, origins, polynomials = (np.array(part) for part in zip(*taken, strict=True))
                    polynomials = polynomials.reshape(len(taken), DENSE, -1)
                    return Steps(starts, origins, polynomials, end.copy(), end_totals.copy(), min(step, 1.0))
                t[0] = start + width
                y[:], rates[:], running[:] = end, end_rates, end_totals
            elif wrong > 1:
                step = width * max(SHRINK, SAFETY * wrong**EXPONENT)
            else:  # no number: the voltages or the state are none
                break
            if step < LEAST_STEP:
                break
        return None


def _buffer(function: ca.Function, arguments: list[Any], results: list[Any]) -> tuple[Any, Callable[[], None]]:
    """A function bound to arrays: what holds it together, and the call."""
    buffer: Any
    buffer, call = function.buffer()
    for k, argument in enumerate(arguments):
        buffer.set_arg(k, memoryview(argument))
    for k, result in enumerate(results):
        buffer.set_res(k, memoryview(result))
    return buffer, call
