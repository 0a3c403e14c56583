"""A replay everywhere, not at points alone: pieces of an interval on which every quantity is nearly a polynomial.

The pieces are the integrator's own steps, so they are short where much happens. Each is known at the Chebyshev points
of its length, both ends included; between them it is interpolated. What has a kink in it, such as energy that flows
back, is cut at the kink.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Final

import numpy as np

NODES: Final = 9
"""Of a piece. The integrator's polynomials have degree 7, the voltages' up to 6, a power's is the sum."""

FINE: Final = 17
"""Equally spaced points of a piece at which extremes are looked for: what is missed is the square of 1/16 of it."""

SHARES: Final[np.ndarray] = (1 - np.cos(np.pi * np.arange(NODES) / (NODES - 1))) / 2
"""Chebyshev points in 0..1, both ends included."""

_TO_POWERS: Final[np.ndarray] = np.linalg.inv(np.vander(SHARES, increasing=True))
_TO_FINE: Final[np.ndarray] = np.vander(np.linspace(0, 1, FINE), NODES, increasing=True) @ _TO_POWERS
_EXPONENTS: Final[np.ndarray] = np.arange(1, NODES + 1)
"""Of an integral's powers."""

CELLS: Final = 64
"""Equal parts of a piece in which a sign change is looked for. A dip below zero inside one of them is missed: some
1e-6 of what the piece turns over, and a motion has a thousand pieces."""

NEWTON_STEPS: Final = 3
"""From a chord over a cell. An integral changes with the square of what its cut is off."""

_WEIGHTS: Final[np.ndarray] = (1 / _EXPONENTS) @ _TO_POWERS
"""Of Clenshaw and Curtis' rule on 0..1: the integral of the interpolating polynomial."""


@dataclass(frozen=True)
class Samples:
    """States and voltages, arrays (pieces, points, n), SI."""

    position: np.ndarray
    speed: np.ndarray
    current_d: np.ndarray
    current_q: np.ndarray
    voltage_d: np.ndarray
    voltage_q: np.ndarray


@dataclass(frozen=True)
class Pieces:
    """All pieces of a replay, K of them in the order of time."""

    interval: np.ndarray  # (K,) which interval a piece belongs to
    width: np.ndarray  # (K,) s
    nodes: Samples  # at `SHARES` of each width

    @cached_property
    def extremes(self) -> tuple[Samples, Samples]:
        """Lowest and highest of `FINE` equally spaced points of each piece, arrays (K, n)."""
        values = np.concatenate([getattr(self.nodes, field.name) for field in fields(Samples)], axis=2)
        by_node = np.ascontiguousarray(values.transpose(1, 0, 2)).reshape(NODES, -1)  # one large product
        fine = (_TO_FINE @ by_node).reshape(FINE, len(values), -1)
        lowest, highest = (np.split(found, len(fields(Samples)), axis=1) for found in (fine.min(0), fine.max(0)))
        return Samples(*lowest), Samples(*highest)

    def integral(self, values: np.ndarray) -> np.ndarray:
        """Over time, of values at the nodes, (K, `NODES`, n) -> (n,)."""
        over_pieces: np.ndarray = np.einsum("m,kmn->kn", _WEIGHTS, values)
        total: np.ndarray = self.width @ over_pieces
        return total

    def integral_below_zero(self, values: np.ndarray) -> np.ndarray:
        """Over time, of max(-value, 0), (K, `NODES`, n) -> (n,)."""
        mixed = (values.min(axis=1) < 0) & (values.max(axis=1) > 0)  # (K, n)
        total = self.integral(np.where(mixed[:, None, :], 0.0, np.maximum(-values, 0)))
        piece, joint = np.nonzero(mixed)
        np.add.at(total, joint, self.width[piece] * _below_zero(values[piece, :, joint]))
        return total


def _below_zero(values: np.ndarray) -> np.ndarray:
    """Integrals over 0..1 of max(-p, 0) for polynomials p through values at `SHARES`, (m, `NODES`) -> (m,).

    Cell by cell from the antiderivative, a cell with a sign change cut at the root in it.
    """
    powers = values @ _TO_POWERS.T
    of_integral = np.hstack([np.zeros((len(values), 1)), powers / _EXPONENTS])
    ends = np.linspace(0, 1, CELLS + 1)
    p, integral = _at(powers, ends), _at(of_integral, ends)
    low, high = p[:, :-1], p[:, 1:]
    whole: np.ndarray = np.where((low <= 0) & (high <= 0), -np.diff(integral, axis=1), 0.0).sum(axis=1)

    k, cell = np.nonzero(low * high < 0)
    root = _root(powers[k], ends[cell], ends[cell + 1], low[k, cell], high[k, cell])
    at_root = _at(of_integral[k], root[:, None])[:, 0]
    part = np.where(low[k, cell] < 0, integral[k, cell] - at_root, at_root - integral[k, cell + 1])
    np.add.at(whole, k, np.maximum(part, 0.0))
    return whole


def _at(powers: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Polynomials, (m, k) coefficients of 1, s, s^2, ..., at s of shape (p,) for all or (m, p) -> (m, p)."""
    found: np.ndarray = np.zeros((len(powers), s.shape[-1]))
    for coefficient in powers.T[::-1]:
        found = found * s + coefficient[:, None]
    return found


def _root(powers: np.ndarray, a: np.ndarray, b: np.ndarray, at_a: np.ndarray, at_b: np.ndarray) -> np.ndarray:
    """Root in a..b of each polynomial, whose values at the ends differ in sign, all (m,)."""
    slopes = powers[:, 1:] * np.arange(1, powers.shape[1])
    s: np.ndarray = (a * at_b - b * at_a) / (at_b - at_a)
    for _ in range(NEWTON_STEPS):
        value, slope = _at(powers, s[:, None])[:, 0], _at(slopes, s[:, None])[:, 0]
        step = np.divide(value, slope, out=np.zeros_like(value), where=slope != 0)
        s = np.clip(s - step, a, b)
    return s


def graded(count: int) -> np.ndarray:
    """Ends of pieces of a stiff interval 0..1, dense at its start where what was before dies out, (count + 1,)."""
    ends: np.ndarray = np.linspace(0, 1, count + 1) ** 3
    return ends
