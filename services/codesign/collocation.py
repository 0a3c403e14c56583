"""Collocation on one interval: points, differentiation matrix, end weights, quadrature.

Points c_1 < ... < c_d lie in (0, 1]; with c_0 = 0 they carry the Lagrange polynomial of a state  (Section III-B).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import comb

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import Legendre

SCHEMES = ("radau", "legendre")
DEGREES = (1, 2, 3, 4, 5)


@dataclass(frozen=True)
class Collocation:
    """A scheme as data. With values y_0 at 0 and y_j at c_j, the polynomial's derivative at c_j is D[j-1] @ y."""

    scheme: str
    degree: int
    points: np.ndarray  # (d,) c_1..c_d
    differentiation: np.ndarray  # (d, d + 1)
    end: np.ndarray  # (d + 1,) value at 1
    weights: np.ndarray  # (d,) quadrature weights on the points, sum 1

    @property
    def bernstein(self) -> np.ndarray:
        """Bernstein coefficients of the polynomial through y_0..y_d are this matrix times y, (d + 1, d + 1)."""
        d, nodes = self.degree, np.concatenate([[0.0], self.points])
        values = [[comb(d, k) * c**k * (1 - c) ** (d - k) for k in range(d + 1)] for c in nodes]
        inverse: np.ndarray = np.linalg.inv(np.array(values))
        return inverse

    def at(self, share: float) -> np.ndarray:
        """Weights (d + 1,) of y_0..y_d in the polynomial's value at a share of the interval, 0..1."""
        return np.array([basis(share) for basis in lagrange_basis(np.concatenate([[0.0], self.points]))])

    @property
    def ends_on_point(self) -> bool:
        """Whether c_d = 1, so that the last point is the interval's end (Radau)."""
        return self.scheme == "radau"


def collocation_points(scheme: str, degree: int) -> np.ndarray:
    """Points in (0, 1], shape (degree,).

    Legendre: roots of P_d. Radau (right): roots of P_d - P_(d-1), the last of which is 1.
    """
    basis = Legendre.basis(degree)
    polynomial = basis - Legendre.basis(degree - 1) if scheme == "radau" else basis
    roots = np.sort(polynomial.roots().real)
    points: np.ndarray = (roots + 1) / 2
    if scheme == "radau":
        points[-1] = 1.0
    return points


@lru_cache(maxsize=32)
def collocation(scheme: str, degree: int) -> Collocation:
    """Build a scheme.

    Raises
    ------
    ValueError
        For an unknown scheme or a degree outside 1..5.
    """
    if scheme not in SCHEMES:
        raise ValueError(f"scheme {scheme!r}: must be one of {', '.join(SCHEMES)}")
    if degree not in DEGREES:
        raise ValueError(f"degree {degree}: must be between {DEGREES[0]} and {DEGREES[-1]}")
    points = collocation_points(scheme, degree)
    lagrange = lagrange_basis(np.concatenate([[0.0], points]))
    return Collocation(
        scheme=scheme,
        degree=degree,
        points=points,
        differentiation=np.array([[basis.deriv()(c) for basis in lagrange] for c in points]),
        end=np.array([basis(1.0) for basis in lagrange]),
        weights=np.array([basis.integ()(1.0) for basis in lagrange_basis(points)]),
    )


def lagrange_basis(nodes: np.ndarray) -> list[Polynomial]:
    """Polynomials that are 1 at one of the nodes and 0 at the others."""
    basis = []
    for j, node in enumerate(nodes):
        others = np.delete(nodes, j)
        numerator = Polynomial.fromroots(others) if len(others) else Polynomial([1.0])
        basis.append(numerator / float(np.prod(node - others)))
    return basis
