"""Collocation schemes: closed forms, exactness, and the order of convergence seen through the interval's own code."""

from __future__ import annotations

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.integrate import solve_ivp

from services.codesign.collocation import DEGREES, SCHEMES, collocation
from services.codesign.interval import IntervalLayout, interval_expressions
from services.codesign.motor import evaluate_motor
from services.codesign.motor_data import MotorData
from services.codesign.robot import Robot
from tests.numerics.arms import pose

ROUNDING = 1e-12
"""Absolute; Lagrange bases of up to six nodes in [0, 1] lose two to three of sixteen digits."""
ORDER = 0.2
"""How near a fitted order must be to the theoretical one, from two successive halvings of the step."""

EVERY = [pytest.param(scheme, degree, id=f"{scheme}-{degree}") for scheme in SCHEMES for degree in DEGREES]

r6, r10, r15, r30, r70 = (math.sqrt(number) for number in (6, 10, 15, 30, 70))
inner, outer = math.sqrt(3 - 2 * math.sqrt(6 / 5)) / math.sqrt(7), math.sqrt(3 + 2 * math.sqrt(6 / 5)) / math.sqrt(7)
near, far = math.sqrt(5 - 2 * math.sqrt(10 / 7)) / 3, math.sqrt(5 + 2 * math.sqrt(10 / 7)) / 3
w5, v5 = (322 - 13 * r70) / 1800, (322 + 13 * r70) / 1800

POINTS = {
    # Radau: Hairer & Wanner, Solving Ordinary Differential Equations II, section IV.5; degrees 4 and 5 as decimals.
    ("radau", 1): [1],
    ("radau", 2): [1 / 3, 1],
    ("radau", 3): [(4 - r6) / 10, (4 + r6) / 10, 1],
    ("radau", 4): [0.08858795951270395, 0.4094668644407347, 0.7876594617608471, 1],
    ("radau", 5): [0.05710419611451768, 0.2768430136381238, 0.5835904323689168, 0.8602401356562195, 1],
    # Gauss-Legendre on [-1, 1]: Abramowitz & Stegun, section 25.4.
    ("legendre", 1): [1 / 2],
    ("legendre", 2): [(1 - 1 / math.sqrt(3)) / 2, (1 + 1 / math.sqrt(3)) / 2],
    ("legendre", 3): [(1 - r15 / 5) / 2, 1 / 2, (1 + r15 / 5) / 2],
    ("legendre", 4): [(1 - outer) / 2, (1 - inner) / 2, (1 + inner) / 2, (1 + outer) / 2],
    ("legendre", 5): [(1 - far) / 2, (1 - near) / 2, 1 / 2, (1 + near) / 2, (1 + far) / 2],
}
WEIGHTS = {
    ("radau", 1): [1],
    ("radau", 2): [3 / 4, 1 / 4],
    ("radau", 3): [(16 - r6) / 36, (16 + r6) / 36, 1 / 9],
    ("legendre", 1): [1],
    ("legendre", 2): [1 / 2, 1 / 2],
    ("legendre", 3): [5 / 18, 4 / 9, 5 / 18],
    ("legendre", 4): [(18 - r30) / 72, (18 + r30) / 72, (18 + r30) / 72, (18 - r30) / 72],
    ("legendre", 5): [w5, v5, 64 / 225, v5, w5],
}


@pytest.mark.parametrize(("scheme", "degree"), EVERY)
def test_points_equal_closed_forms(scheme, degree):
    assert collocation(scheme, degree).points == pytest.approx(POINTS[scheme, degree], abs=ROUNDING)


@pytest.mark.parametrize(("scheme", "degree"), [pytest.param(*key, id=f"{key[0]}-{key[1]}") for key in WEIGHTS])
def test_weights_equal_closed_forms(scheme, degree):
    assert collocation(scheme, degree).weights == pytest.approx(WEIGHTS[scheme, degree], abs=ROUNDING)


@pytest.mark.parametrize(
    ("scheme", "A"),
    [
        ("radau", [[5 / 12, -1 / 12], [3 / 4, 1 / 4]]),
        ("legendre", [[1 / 4, 1 / 4 - math.sqrt(3) / 6], [1 / 4 + math.sqrt(3) / 6, 1 / 4]]),
    ],
)
def test_differentiation_inverts_the_runge_kutta_matrix(scheme, A):
    """Butcher matrices of Radau IIA and Gauss with two stages (Hairer & Wanner II, tables 5.1 and 5.5)."""
    D = collocation(scheme, 2).differentiation[:, 1:]
    assert np.linalg.inv(D) == pytest.approx(np.array(A), abs=ROUNDING)


@pytest.mark.parametrize(("scheme", "degree"), EVERY)
def test_differentiation_and_end_value_are_exact_on_polynomials(scheme, degree):
    s = collocation(scheme, degree)
    nodes = np.concatenate([[0.0], s.points])
    for power in range(degree + 1):
        slopes = power * s.points ** max(power - 1, 0)
        assert s.differentiation @ nodes**power == pytest.approx(slopes, abs=1e2 * ROUNDING)  # entries of up to 40
        assert s.end @ nodes**power == pytest.approx(1.0, abs=ROUNDING)
    assert np.abs(s.differentiation @ nodes ** (degree + 1) - (degree + 1) * s.points**degree).max() > 1e-4


@pytest.mark.parametrize(("scheme", "degree"), EVERY)
def test_quadrature_is_exact_up_to_its_degree_and_no_further(scheme, degree):
    s = collocation(scheme, degree)
    exact = 2 * degree - (2 if scheme == "radau" else 1)
    errors = [abs(s.weights @ s.points**power - 1 / (power + 1)) for power in range(exact + 2)]
    assert max(errors[:-1]) < ROUNDING
    assert errors[-1] > 1e-7  # the smallest of the ten is 1.4e-6


@pytest.mark.parametrize(("scheme", "degree"), EVERY)
def test_stability_function_is_the_pade_approximant(scheme, degree):
    """On y' = z y: the (d-1, d) approximant of exp z for Radau, (d, d) for Legendre (Hairer & Wanner II, IV.3)."""
    s = collocation(scheme, degree)
    top = degree - 1 if scheme == "radau" else degree
    for z in (-0.7, -3.0, -40.0):
        interior = np.linalg.solve(s.differentiation[:, 1:] - z * np.eye(degree), -s.differentiation[:, 0])
        end = s.end @ np.concatenate([[1.0], interior])
        P = _pade(top, degree, z)
        assert end == pytest.approx(P / _pade(degree, top, -z), abs=ROUNDING)


def _pade(own: int, other: int, z: float) -> float:
    """Numerator of the (own, other) approximant of exp; the denominator is its mirror image."""
    f = math.factorial
    return sum(f(own) * f(own + other - k) / (f(own - k) * f(own + other) * f(k)) * z**k for k in range(own + 1))


@pytest.mark.parametrize("degree", [0, 6])
def test_degrees_beyond_five_are_refused(degree):
    with pytest.raises(ValueError, match=f"degree {degree}"):
        collocation("radau", degree)


def test_unknown_choices_are_refused():
    with pytest.raises(ValueError, match="scheme 'lobatto'"):
        collocation("lobatto", 2)
    with pytest.raises(ValueError, match="control 'torque'"):
        IntervalLayout(1, "radau", 1, control="torque")
    with pytest.raises(ValueError, match="dynamics 'hybrid'"):
        IntervalLayout(1, "radau", 1, dynamics="hybrid")


# ---- order of convergence, through the production interval

DESIGN = np.array([60, 14, 36, 3, 5.5, 6, 2]) * 1e-3
MASS, LENGTH, GRAVITY, GEAR = 2.0, 0.3, 9.81, 30.0
STARTS = [np.array([q, qd, 0, 0]) for q, qd in ((0.4, -0.2), (-0.9, 0.1), (1.3, 0.0), (0.1, 0.2))]
U_D, U_Q, CURRENT_RATE = -1.0, 4.0, 0.4  # V, V, A/s


def pendulum() -> Robot:
    """A point mass on a rod about the y axis, hanging along -z at home, its motor on the base."""
    return Robot(
        name="pendulum",
        gravity=np.array([0, 0, -GRAVITY]),
        screw_axes=np.array([[0.0, 1, 0, 0, 0, 0]]),
        link_com_home=pose(np.eye(3), np.array([0, 0, -LENGTH]))[None],
        link_mass=np.array([MASS]),
        link_inertia=np.zeros((1, 3, 3)),
        motor_position=np.zeros((1, 3)),
        tool_home=np.eye(4),
        gear_ratio=np.array([GEAR]),
        joint_lower=np.array([-3.0]),
        joint_upper=np.array([3.0]),
        rotor_speed_limit=100 * np.pi,
    )


def pendulum_slopes(motor, i_d: float, i_q: float, q: float, qd: float) -> list[float]:
    """Eqs. (1) and (4) of the pendulum, by hand."""
    R, L, Phi, P, omega = motor.phase_resistance, motor.inductance, motor.flux_linkage, 4, GEAR * qd
    inertia = MASS * LENGTH**2 + motor.rotor_inertia_axial * GEAR**2
    torque = GEAR * 1.5 * P * Phi * i_q - MASS * GRAVITY * LENGTH * math.sin(q)
    return [
        qd,
        torque / inertia,
        -R / L * i_d + P * omega * i_q + U_D / L,
        -R / L * i_q - P * omega * (i_d + Phi / L) + U_Q / L,
    ]


def pendulum_end(start: np.ndarray, final_time: float, current_control: bool) -> np.ndarray:
    """State at the end, integrated to thirteen digits by a method of another family."""
    motor, _ = evaluate_motor(DESIGN, MotorData())

    def slopes(t: float, x: np.ndarray) -> list[float]:
        i_d, i_q = (0.0, CURRENT_RATE * t) if current_control else (x[2], x[3])
        return pendulum_slopes(motor, i_d, i_q, x[0], x[1])

    return solve_ivp(slopes, (0, final_time), start, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]


def interval_step(layout: IntervalLayout) -> ca.Function:
    """The production interval's equalities and their slope in the states, for Newton's method."""
    e = interval_expressions(pendulum(), layout)
    equalities = e.constraints[: layout.equalities]
    unknown = e.variables[: layout.point_size * layout.stops]
    inputs = [e.start, e.variables, e.design, e.final_time, e.width, e.parameters]
    return ca.Function("step", inputs, [equalities, ca.jacobian(equalities, unknown)])


def collocated_end(
    step: ca.Function, layout: IntervalLayout, start: np.ndarray, intervals: int, final_time: float
) -> np.ndarray:
    """State at the end by the production interval, interval after interval; all scales are 1."""
    parameters = np.concatenate([MotorData().coefficients(), np.ones(7), [GEAR], [0.0], np.ones(4), [1.0, 0.0]])
    held = layout.point_size * layout.stops
    state, current = start, 0.0
    for _ in range(intervals):
        if layout.control == "voltage":
            variables = np.concatenate([np.tile(state, layout.stops), [U_D, U_Q]])
        else:
            current += CURRENT_RATE * final_time / intervals
            variables = np.concatenate([np.tile(state[:2], layout.stops), [0.0, current]])
        for _ in range(6):
            value, slope = step(state, variables, DESIGN, final_time, 1 / intervals, parameters)
            variables[:held] -= np.linalg.solve(slope.full(), value.full().ravel())
        state = variables[layout.end_state]
    return state


def observed_order(layout: IntervalLayout, final_time: float, coarse: int) -> float:
    """Halvings of the error (root mean square over the starts) for one halving of the step."""
    step = interval_step(layout)
    exact = np.array([pendulum_end(start, final_time, layout.control == "current") for start in STARTS])
    errors = []
    for N in (coarse, 2 * coarse):
        found = np.array([collocated_end(step, layout, start, N, final_time) for start in STARTS])
        error = ((found - exact) / np.abs(exact).max(axis=0))[:, : layout.point_size]
        errors.append(np.sqrt(np.mean(error**2)))
    return float(np.log2(errors[0] / errors[1]))


COARSE = {1: 32, 2: 8, 3: 4, 4: 4, 5: 2}
"""Intervals at which the asymptote is reached and rounding (5e-13) is not; 1 to 3 electrical time constants each."""


@pytest.mark.parametrize(("scheme", "degree"), EVERY)
def test_observed_order_at_the_nodes(scheme, degree):
    """2d - 1 for Radau, 2d for Legendre, of a pendulum and its motor under a voltage step."""
    order = observed_order(IntervalLayout(1, scheme, degree), 0.006, COARSE[degree])
    assert order == pytest.approx(2 * degree - (1 if scheme == "radau" else 0), abs=ORDER)


@pytest.mark.parametrize(("scheme", "degree"), [case for case in EVERY if case.values[1] < 4])
def test_observed_order_under_a_current_ramp(scheme, degree):
    """The same orders with the currents given. From degree 4 rounding meets the error before the order shows."""
    order = observed_order(IntervalLayout(1, scheme, degree, "current"), 0.4, COARSE[degree])
    assert order == pytest.approx(2 * degree - (1 if scheme == "radau" else 0), abs=ORDER)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_observed_order_with_forward_dynamics(scheme):
    order = observed_order(IntervalLayout(1, scheme, 2, dynamics="forward"), 0.006, COARSE[2])
    assert order == pytest.approx(3 if scheme == "radau" else 4, abs=ORDER)


def test_voltages_of_the_current_ramp_are_the_motor_equations():
    """With currents given, the inequalities are u at the points: u = R i + rotation + L di/dt  (eq. 1)."""
    layout = IntervalLayout(1, "radau", 3, "current")
    e = interval_expressions(pendulum(), layout)
    inputs = [e.start, e.variables, e.design, e.final_time, e.width, e.parameters]
    value = ca.Function("value", inputs, [e.constraints, e.effort])
    rng = np.random.default_rng(3)
    start, variables, T, share = rng.normal(size=4), rng.normal(size=layout.variables), 0.3, 0.25
    parameters = np.concatenate([MotorData().coefficients(), np.ones(7), [GEAR], [0.0], np.ones(4), [1.0, 0.0]])
    constraints, effort = (out.full().ravel() for out in value(start, variables, DESIGN, T, share, parameters))
    motor, _ = evaluate_motor(DESIGN, MotorData())
    R, L, Phi, P = motor.phase_resistance, motor.inductance, motor.flux_linkage, 4
    first, last = start[2:], variables[-2:]
    rate = (last - first) / (T * share)
    nodes, qd = np.concatenate([[0.0], collocation("radau", 3).points]), np.array([start[1], *variables[1:6:2]])
    speed = Polynomial.fit(nodes, qd, 3, domain=(0, 1), window=(0, 1))

    def voltages(c: float) -> list[float]:
        i_d, i_q = first + c * (last - first)
        omega = GEAR * speed(c)
        return [R * i_d - P * omega * L * i_q + L * rate[0], R * i_q + P * omega * (L * i_d + Phi) + L * rate[1]]

    found = constraints[layout.equalities :]
    assert found[:8] == pytest.approx(np.ravel([voltages(c) for c in nodes]), rel=1e-11)  # rounding
    at_points = np.square([voltages(c) for c in nodes[1:]])
    assert effort == pytest.approx(T * share * collocation("radau", 3).weights @ at_points.sum(axis=1), rel=1e-11)
    # The rest bounds the speed between the points: with its ends, the coefficients of its Bernstein form.
    coefficients = [qd[0], *found[8:], qd[-1]]
    basis = [math.comb(3, k) * Polynomial([0, 1]) ** k * Polynomial([1, -1]) ** (3 - k) for k in range(4)]
    through = sum(b * c for b, c in zip(basis, coefficients, strict=True))
    assert through.coef == pytest.approx(speed.coef, rel=1e-10)


@pytest.mark.parametrize(("scheme", "degree"), EVERY)
def test_bernstein_coefficients_enclose_and_reproduce(scheme, degree):
    s, rng = collocation(scheme, degree), np.random.default_rng(degree)
    nodes, share = np.concatenate([[0.0], s.points]), np.linspace(0, 1, 50)
    values = rng.normal(size=degree + 1)
    coefficients = s.bernstein @ values
    along = np.array([s.at(c) @ values for c in share])
    assert along.max() <= coefficients.max() + ROUNDING
    assert along.min() >= coefficients.min() - ROUNDING
    for c, value in zip(nodes, values, strict=True):
        assert s.at(c) @ values == pytest.approx(value, abs=1e2 * ROUNDING)
        terms = [math.comb(degree, k) * c**k * (1 - c) ** (degree - k) for k in range(degree + 1)]
        assert terms @ coefficients == pytest.approx(value, abs=1e2 * ROUNDING)


@pytest.mark.parametrize(
    ("scheme", "degree", "checks"),
    [("radau", 1, [0, 1]), ("radau", 2, [0, 1 / 3, 1]), ("legendre", 1, [0, 0.5, 1])],
)
def test_voltages_that_follow_are_bounded_at_the_ends_and_the_points(scheme, degree, checks):
    layout = IntervalLayout(1, scheme, degree, "current")
    assert layout.voltage_checks == pytest.approx(checks)
    assert layout.inequalities == 2 * len(checks) + degree - 1
    assert replace(layout, control="voltage").inequalities == 0
