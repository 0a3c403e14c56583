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
    def fine(self) -> Samples:
        """At `FINE` equally spaced points of each piece."""
        values = [getattr(self.nodes, field.name) for field in fields(Samples)]
        return Samples(*np.split(_TO_FINE @ np.concatenate(values, axis=2), len(values), axis=2))

    def integral(self, values: np.ndarray) -> np.ndarray:
        """Over time, of values at the nodes, (K, `NODES`, n) -> (n,)."""
        over_pieces: np.ndarray = np.einsum("m,kmn->kn", _WEIGHTS, values)
        total: np.ndarray = self.width @ over_pieces
        return total

    def integral_below_zero(self, values: np.ndarray) -> np.ndarray:
        """Over time, of max(-value, 0), (K, `NODES`, n) -> (n,); exact for polynomials of degree `NODES` - 1."""
        mixed = (values.min(axis=1) < 0) & (values.max(axis=1) > 0)  # (K, n)
        total = self.integral(np.where(mixed[:, None, :], 0.0, np.maximum(-values, 0)))
        for k, joint in zip(*np.nonzero(mixed), strict=True):
            total[joint] += self.width[k] * _below_zero(values[k, :, joint])
        return total


def _below_zero(values: np.ndarray) -> float:
    """Integral over 0..1 of max(-p, 0) for the polynomial p through values at `SHARES`."""
    powers = _TO_POWERS @ values
    roots = np.roots(powers[::-1])
    # Cut at every root nearly on the interval; a cut that is none does no harm.
    inside = (np.abs(roots.imag) < 1e-6) & (roots.real > 0) & (roots.real < 1)
    cuts = np.array([0.0, *np.sort(roots.real[inside]), 1.0])
    parts = np.diff(cuts[:, None] ** _EXPONENTS @ (powers / _EXPONENTS))
    return float(-parts[parts < 0].sum())


def graded(count: int) -> np.ndarray:
    """Ends of pieces of a stiff interval 0..1, dense at its start where what was before dies out, (count + 1,)."""
    ends: np.ndarray = np.linspace(0, 1, count + 1) ** 3
    return ends
