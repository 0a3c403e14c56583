"""Variable steps of order 8 over an interval: Dormand and Prince's pair with its dense output.

Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I (1993), section II.5 and II.6: DOP853. The
tableau is scipy's; steps with their control are one CasADi function, so that they are compiled with the plant. An
explicit method: an interval that it cannot cross in `MOST_STEPS` is stiff and left to another.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

Expression = Any

STEPS_A_CALL = 32
"""Tries that one call makes; those that are left over when the end is reached cost little."""

MOST_STEPS = 10 * STEPS_A_CALL
"""Tries in one interval. Motions of the paper take 10 to 40, with voltages that reverse many currents up to 150."""

FIRST_STEP = 0.2
LEAST_STEP = 1e-9
"""Shares of an interval."""

SAFETY, SHRINK, GROW = 0.9, 0.2, 8.0
"""Of the step that would just do, and the most that one step differs from the one before."""

EXPONENT = -1 / 8
TINY = 1e-12

DENSE = 7
"""Coefficients of the dense output, a polynomial of degree 7 in each step."""


def step_function(slopes: ca.Function, tolerance: float, quadrature_tolerance: float) -> ca.Function:
    """One step: (share, state, rates there, totals, step, parameters) -> (state, rates, totals, error, dense).

    `slopes` is (share, state, parameters) -> (rates, rates of quadratures). States are kept to `tolerance`,
    absolute and relative, quadratures to theirs; the step will do where `error` is at most 1. `dense` has a column
    for each coefficient of the states' polynomial.
    """
    from scipy.integrate import DOP853  # a second that no process should wait for whose plants are compiled

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


def steps_function(step: ca.Function) -> ca.Function:
    """`STEPS_A_CALL` tries of `step`: (course, parameters) -> (courses, dense outputs), a column for each try.

    A course is (share, next step, state, rates there, totals). A try that is not accurate enough leaves its share
    where it was; at the end, or once no step is small enough, nothing happens any more.
    """
    states, rates, quadratures = (step.size1_in(k) for k in (1, 2, 3))
    parts = np.cumsum([0, 1, 1, states, rates, quadratures]).tolist()
    course, p = ca.MX.sym("course", parts[-1]), ca.MX.sym("parameters", step.size1_in(5))
    t, h, y, K, totals = ca.vertsplit(course, parts)

    last = h >= 1 - t
    width = ca.if_else(last, 1 - t, h)
    end, end_rates, end_totals, error, dense = step(t, y, K, totals, width, p)
    grown = width * ca.fmin(GROW, ca.fmax(SHRINK, SAFETY * ca.fmax(error, TINY) ** EXPONENT))
    taken = ca.vertcat(ca.if_else(last, 1, t + width), grown, end, end_rates, end_totals)
    shrunk = width * ca.fmax(SHRINK, SAFETY * error**EXPONENT)
    refused = ca.vertcat(t, ca.if_else(error > 1, shrunk, 0), y, K, totals)  # no number: no step will do
    after = ca.if_else(error <= 1, taken, refused)
    try_step = ca.Function("try_step", [course, p], [after, ca.vec(dense)])
    nothing = ca.Function("no_step", [course, p], [course, ca.DM.zeros(states * DENSE)])
    under_way = ca.logic_and(t < 1, h >= LEAST_STEP)
    either = ca.Function.if_else("try_or_not", try_step, nothing)
    once = ca.Function("once", [course, p], [*either(under_way, course, p)])
    many = once.mapaccum("steps_of_parameters", STEPS_A_CALL)
    return ca.Function("steps", [course, p], [*many(course, ca.repmat(p, 1, STEPS_A_CALL))])


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
    """Crosses intervals with compiled steps, whose arguments and results stay in place between calls.

    Not for several threads at once.
    """

    def __init__(self, slopes: ca.Function, steps: ca.Function) -> None:
        states, quadratures = slopes.size1_out(0), slopes.size1_out(1)
        self._course, self._parameters = np.zeros(steps.size1_in(0)), np.zeros(slopes.size1_in(2))
        self._courses = np.zeros((STEPS_A_CALL, len(self._course)))
        self._dense = np.zeros((STEPS_A_CALL, DENSE * states))
        self._ends = np.cumsum([1, 1, states, states, quadratures])
        t, _, y, rates, quadrature_rates, _ = np.split(self._course, self._ends)
        self._buffers = (
            _buffer(slopes, [t, y, self._parameters], [rates, quadrature_rates]),
            _buffer(steps, [self._course, self._parameters], [self._courses, self._dense]),
        )

    def cross(
        self, state: np.ndarray, totals: np.ndarray, parameters: np.ndarray, step: float = FIRST_STEP
    ) -> Steps | None:
        """From share 0 to 1; None when `MOST_STEPS` do not suffice, or no step is small enough.

        `state` and `totals` are those at the start; `step` is tried first. Nothing is remembered between calls.
        """
        (_, evaluate_slopes), (_, evaluate_steps) = self._buffers
        t, h, y, _, _, running = np.split(self._course, self._ends)
        t[0], h[0], y[:], running[:], self._parameters[:] = 0.0, step, state, totals, parameters
        evaluate_slopes()
        befores, polynomials = [], []
        for _ in range(MOST_STEPS // STEPS_A_CALL):
            evaluate_steps()
            before = np.vstack([self._course, self._courses[:-1]])
            taken = self._courses[:, 0] > before[:, 0]
            befores.append(before[taken])
            polynomials.append(self._dense[taken])
            self._course[:] = self._courses[-1]
            if t[0] >= 1:
                at = np.concatenate(befores)
                return Steps(
                    starts=at[:, 0],
                    origins=at[:, 2 : 2 + len(y)],
                    polynomials=np.concatenate(polynomials).reshape(len(at), DENSE, -1),
                    end=y.copy(),
                    totals=running.copy(),
                    next_step=min(float(h[0]), 1.0),
                )
            if not h[0] >= LEAST_STEP:
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
