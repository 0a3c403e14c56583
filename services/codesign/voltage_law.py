"""The voltage law of a motion: what the drives are told, at every time and not at grid points alone.

Voltages are polynomials on each interval. Voltage control: constants (eq. 6). Current control: with speeds of degree
d and currents linear in time, eq. (1) gives voltages of degree d + 1, so that d + 2 values say all  (MODEL section 5).
Coefficients are those of powers of s = (t - t_w) / (t_(w+1) - t_w) in 0..1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from services.codesign.collocation import Collocation, lagrange_basis
from services.codesign.motion import Motion, motors_of_design
from services.codesign.motor import steady_voltages
from services.codesign.problem import Problem


@dataclass(frozen=True)
class VoltageLaw:
    """Piecewise polynomial voltages in the d- and q-axis."""

    breaks: np.ndarray  # (N + 1,) s, ends of the intervals
    voltage_d: np.ndarray  # (N, k, n) V, coefficient of s^0, s^1, ...
    voltage_q: np.ndarray  # (N, k, n) V

    @property
    def intervals(self) -> int:
        """Number of intervals N."""
        return len(self.breaks) - 1

    def at(self, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Voltages (d, q) [V] in every interval at shares s of its length, shape (m,) -> (N, m, n) each."""
        powers = share[:, None] ** np.arange(self.voltage_d.shape[1])
        return (
            np.einsum("mk,wkn->wmn", powers, self.voltage_d),
            np.einsum("mk,wkn->wmn", powers, self.voltage_q),
        )

    def within(self, interval: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Voltages (d, q) [V] in intervals (k,) at shares of their lengths (k, m) -> (k, m, n) each."""
        powers = share[:, :, None] ** np.arange(self.voltage_d.shape[1])
        return powers @ self.voltage_d[interval], powers @ self.voltage_q[interval]


@dataclass(frozen=True)
class Path:
    """The polynomials behind a motion: values on each interval at its start and at the collocation points."""

    breaks: np.ndarray  # (N + 1,) s
    nodes: np.ndarray  # (d + 1,) 0, c_1 .. c_d
    position: np.ndarray  # (N, d + 1, n) rad
    speed: np.ndarray  # (N, d + 1, n) rad/s

    def at(self, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position [rad] and speed [rad/s] in every interval at shares of its length, (m,) -> (N, m, n) each."""
        basis = np.array([polynomial(share) for polynomial in lagrange_basis(self.nodes)])
        return np.einsum("jm,wjn->wmn", basis, self.position), np.einsum("jm,wjn->wmn", basis, self.speed)


def path_of(problem: Problem, motion: Motion) -> Path:
    """Cut a motion into its intervals."""
    scheme, stops = problem.layout.collocation, problem.layout.stops
    ends = np.arange(0, len(motion.time), stops)
    return Path(
        breaks=motion.time[ends],
        nodes=np.concatenate([[0.0], scheme.points]),
        position=_by_interval(motion.position, ends, scheme),
        speed=_by_interval(motion.speed, ends, scheme),
    )


def voltage_law(problem: Problem, design: np.ndarray, motion: Motion) -> VoltageLaw:
    """The law that a motion made with `design`, shape (n, 7) [m], was computed with."""
    path = path_of(problem, motion)
    ends = np.arange(0, len(motion.time), problem.layout.stops)
    if problem.layout.control == "voltage":
        return VoltageLaw(path.breaks, motion.voltage_d[ends[1:], None, :], motion.voltage_q[ends[1:], None, :])
    share = _chebyshev(problem.layout.degree + 2)
    _, qd = path.at(share)
    motor, omega = motors_of_design(design, problem), problem.robot.gear_ratio * qd
    i_d, di_d = _ramp(motion.current_d[ends], path.breaks, share)
    i_q, di_q = _ramp(motion.current_q[ends], path.breaks, share)
    steady_d, steady_q = steady_voltages(i_d, i_q, omega, motor, problem.motor.pole_pairs)
    values = steady_d + motor.inductance * di_d, steady_q + motor.inductance * di_q
    to_powers = np.linalg.inv(np.vander(share, increasing=True))
    return VoltageLaw(path.breaks, *(np.einsum("km,wmn->wkn", to_powers, u) for u in values))


def _by_interval(values: np.ndarray, ends: np.ndarray, scheme: Collocation) -> np.ndarray:
    """(points, n) -> (N, d + 1, n): the start of each interval and its collocation points."""
    return np.stack([values[start : start + scheme.degree + 1] for start in ends[:-1]])


def _ramp(currents: np.ndarray, breaks: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Currents linear between (N + 1, n): values (N, m, n), and slopes [A/s] (N, 1, n)."""
    rise = np.diff(currents, axis=0)[:, None, :]
    return currents[:-1, None, :] + share[None, :, None] * rise, rise / np.diff(breaks)[:, None, None]


def _chebyshev(count: int) -> np.ndarray:
    """Points inside 0..1 at which a polynomial is well determined."""
    nodes: np.ndarray = (1 - np.cos(np.pi * (np.arange(count) + 0.5) / count)) / 2
    return nodes
