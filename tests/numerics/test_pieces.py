"""Integrals and extremes over a replay's pieces, against quadrature and against the integrator's own polynomials."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import DOP853, quad

from services.codesign.pieces import FINE, NODES, SHARES, Pieces, Samples, graded
from services.codesign.runge_kutta import Steps

WIDTHS = np.array([0.3, 0.1, 0.7])


def pieces(values: np.ndarray) -> Pieces:
    return Pieces(np.zeros(len(WIDTHS), int), WIDTHS, Samples(*[values] * 6))


def of_polynomials(seed: int) -> tuple[list[list[np.polynomial.Polynomial]], np.ndarray]:
    """A random polynomial of the highest degree for every piece and two joints, and its values at the nodes."""
    coefficients = np.random.default_rng(seed).normal(size=(len(WIDTHS), 2, NODES))
    made = [[np.polynomial.Polynomial(c) for c in of_piece] for of_piece in coefficients]
    values = np.array([[p(SHARES) for p in of_piece] for of_piece in made]).transpose(0, 2, 1)
    return made, values


def test_integral_is_exact_for_polynomials() -> None:
    made, values = of_polynomials(1)
    expected = [sum(w * quad(of[joint], 0, 1)[0] for w, of in zip(WIDTHS, made, strict=True)) for joint in (0, 1)]
    assert pieces(values).integral(values) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_what_is_below_zero_is_cut_at_the_kinks(seed: int) -> None:
    made, values = of_polynomials(seed)

    def below(p: np.polynomial.Polynomial) -> float:
        kinks = sorted(root.real for root in p.roots() if abs(root.imag) < 1e-9 and 0 < root.real < 1)
        return float(quad(lambda s: max(-p(s), 0.0), 0, 1, points=kinks or None, limit=200)[0])

    expected = [sum(w * below(of[joint]) for w, of in zip(WIDTHS, made, strict=True)) for joint in (0, 1)]
    assert pieces(values).integral_below_zero(values) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_extremes_between_the_nodes_are_seen() -> None:
    """A parabola with its top off the nodes."""
    top = 0.4
    values = np.broadcast_to((1 - (SHARES - top) ** 2)[None, :, None], (len(WIDTHS), NODES, 1))
    lowest, highest = pieces(values).extremes
    assert highest.position.shape == (len(WIDTHS), 1)
    assert values.max() < 1 - 1e-3
    assert highest.position == pytest.approx(1, abs=(1 / (FINE - 1)) ** 2)
    assert lowest.position == pytest.approx(values.min())


def test_states_within_steps_are_the_integrators_own() -> None:
    """The same dense output as scipy's, from its own coefficients."""
    steps = []
    solver = DOP853(lambda t, y: np.array([y[1], -np.sin(3 * y[0]) * t]), 0.0, np.array([1.0, 0.2]), 1.0, rtol=1e-8)
    while solver.status == "running":
        solver.step()
        steps.append(solver.dense_output())
    found = Steps(
        starts=np.array([step.t_old for step in steps]),
        origins=np.array([step.y_old for step in steps]),
        polynomials=np.array([step.F for step in steps]),
        end=solver.y,
        totals=np.zeros(0),
        next_step=1.0,
    )
    inside = found.within(SHARES)
    for step, states, start, width in zip(steps, inside, found.starts, np.diff(found.ends), strict=True):
        times = start + width * SHARES
        assert states == pytest.approx(step(times).T, rel=1e-12)
        assert found.at(times[:-1]) == pytest.approx(step(times[:-1]).T, rel=1e-12)


def test_graded_ends_run_from_start_to_end_and_widen() -> None:
    ends = graded(10)
    assert (ends[0], ends[-1]) == (0, 1)
    assert np.all(np.diff(ends, 2) > 0)
