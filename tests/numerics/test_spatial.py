"""Identities of spatial vectors, on arbitrary poses and twists."""

from __future__ import annotations

import casadi as ca
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import expm

from services.codesign.spatial import (
    adjoint_to_child,
    bracket,
    bracket_dual,
    cylinder_inertia,
    motion_to_child,
    rotation,
    skew,
    spatial_inertia,
    wrench_to_parent,
)

ROUNDING = 1e-11
"""Absolute, for a few products of entries up to 10."""

number = st.floats(-2, 2, allow_nan=False, width=32)
vectors = arrays(float, 3, elements=number)
six = arrays(float, 6, elements=number)
angles = st.floats(-7, 7, allow_nan=False)


@st.composite
def unit_axes(draw) -> np.ndarray:
    azimuth, height = draw(angles), draw(st.floats(-1, 1))
    around = np.sqrt(1 - height**2)
    return np.array([around * np.cos(azimuth), around * np.sin(azimuth), height])


def numeric(expression) -> np.ndarray:
    return np.squeeze(ca.evalf(ca.SX(expression)).full())


def near(a, b) -> bool:
    return bool(np.abs(numeric(a) - np.asarray(b)).max() < ROUNDING)


@given(unit_axes(), angles)
def test_rotation_is_the_exponential_of_its_axis(axis, angle):
    R = numeric(rotation(axis, angle))
    assert near(R, expm(angle * numeric(skew(axis))))
    assert near(R.T @ R, np.eye(3))


@given(vectors, vectors)
def test_skew_is_the_cross_product(a, b):
    assert near(skew(a) @ b, np.cross(a, b))


@given(unit_axes(), angles, vectors, six)
def test_motion_to_child_is_its_matrix_and_the_inverse_of_the_pose(axis, angle, p, V):
    R = rotation(axis, angle)
    moved = motion_to_child(ca.DM(V), R, p)
    assert near(adjoint_to_child(R, p) @ V, numeric(moved))
    pose = np.block([[numeric(R), p[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])
    twist = np.block([[numeric(skew(V[:3])), V[3:, None]], [np.zeros((1, 4))]])
    seen = np.linalg.inv(pose) @ twist @ pose  # a twist is seen in the child frame by conjugation
    assert near(moved, [seen[2, 1], seen[0, 2], seen[1, 0], *seen[:3, 3]])


@given(unit_axes(), angles, vectors, six, six)
def test_power_does_not_depend_on_the_frame(axis, angle, p, V, F):
    R = rotation(axis, angle)
    in_child = ca.dot(ca.DM(F), motion_to_child(ca.DM(V), R, p))
    in_parent = ca.dot(wrench_to_parent(ca.DM(F), R, p), ca.DM(V))
    assert near(in_child, numeric(in_parent))


@given(six, six, six)
def test_brackets_are_dual_antisymmetric_and_obey_jacobi(V, W, F):
    V, W, F = ca.DM(V), ca.DM(W), ca.DM(F)
    assert near(ca.dot(bracket_dual(V, F), W), -numeric(ca.dot(F, bracket(V, W))))
    assert near(bracket(V, W) + bracket(W, V), np.zeros(6))
    cyclic = bracket(V, bracket(W, F)) + bracket(W, bracket(F, V)) + bracket(F, bracket(V, W))
    assert np.abs(numeric(cyclic)).max() < 10 * ROUNDING  # products of three


moments = st.tuples(st.floats(1e-3, 1), st.floats(1e-3, 1))


@given(st.floats(0.1, 10), vectors, moments, unit_axes(), six)
def test_kinetic_energy_is_that_of_the_body_about_its_centre(mass, centre, axial_and_transverse, axis, V):
    axial, transverse = axial_and_transverse
    inertia = numeric(cylinder_inertia(axial, transverse, axis))
    G = numeric(spatial_inertia(mass, centre, ca.DM(inertia)))
    omega, v = V[:3], V[3:] + np.cross(V[:3], centre)
    assert np.abs(V @ G @ V - mass * v @ v - omega @ inertia @ omega) < 100 * ROUNDING  # sums of up to 1e3
    assert np.abs(G - G.T).max() < ROUNDING


@given(moments, unit_axes(), vectors)
def test_cylinder_has_its_inertias_along_and_across_the_axis(axial_and_transverse, axis, w):
    axial, transverse = axial_and_transverse
    inertia = numeric(cylinder_inertia(axial, transverse, axis))
    across = w - axis * (axis @ w)
    assert near(inertia @ axis, axial * axis)
    assert near(inertia @ across, transverse * across)


@given(st.floats(0.1, 10), vectors, six)
def test_a_free_body_keeps_its_energy(mass, centre, V):
    """Without a wrench G V-dot = -bracket_dual(V, G V): the work V' bracket_dual(V, G V) is nil."""
    G = numeric(spatial_inertia(mass, centre, ca.DM(np.diag([0.1, 0.2, 0.25]))))
    work = ca.dot(ca.DM(V), bracket_dual(ca.DM(V), ca.DM(G @ V)))
    assert abs(float(work)) < 1000 * ROUNDING  # products of three, times the mass
