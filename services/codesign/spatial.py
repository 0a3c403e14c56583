"""Spatial vectors after Lynch & Park, Modern Robotics, chapters 3 and 8.

A twist is (omega, v), a wrench (m, f), both of shape (6,). A pose of a child frame in its parent is (R, p).
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

Expression = Any


def skew(w: Expression) -> Expression:
    """[w] with [w] x = w cross x."""
    return ca.vertcat(
        ca.horzcat(0, -w[2], w[1]),
        ca.horzcat(w[2], 0, -w[0]),
        ca.horzcat(-w[1], w[0], 0),
    )


def rotation(axis: np.ndarray, angle: Expression) -> Expression:
    """Rodrigues' formula for a constant unit axis; exact zeros of the axis stay structural zeros."""
    K = np.array(ca.DM(skew(axis)))
    identity, first, second = (ca.sparsify(ca.DM(part)) for part in (np.eye(3), K, K @ K))
    return identity + ca.sin(angle) * first + (1 - ca.cos(angle)) * second


def motion_to_child(V: Expression, R: Expression, p: np.ndarray) -> Expression:
    """Ad of the inverse pose: a twist given in the parent frame, seen in the child frame."""
    omega, v = V[:3], V[3:]
    return ca.vertcat(R.T @ omega, R.T @ (v - skew(p) @ omega))


def wrench_to_parent(F: Expression, R: Expression, p: np.ndarray) -> Expression:
    """Transposed Ad of the inverse pose: a wrench given in the child frame, seen in the parent frame."""
    moment, force = R @ F[:3], R @ F[3:]
    return ca.vertcat(moment + skew(p) @ force, force)


def adjoint_to_child(R: Expression, p: np.ndarray) -> Expression:
    """The 6 x 6 matrix of `motion_to_child`."""
    return ca.vertcat(ca.horzcat(R.T, ca.SX(3, 3)), ca.horzcat(-R.T @ skew(p), R.T))


def bracket(V: Expression, W: Expression) -> Expression:
    """ad_V W, the Lie bracket of two twists."""
    return ca.vertcat(
        ca.cross(V[:3], W[:3]),
        ca.cross(V[3:], W[:3]) + ca.cross(V[:3], W[3:]),
    )


def bracket_dual(V: Expression, F: Expression) -> Expression:
    """-ad_V^T F, so that a free rigid body obeys F = G V-dot + bracket_dual(V, G V)."""
    return ca.vertcat(
        ca.cross(V[:3], F[:3]) + ca.cross(V[3:], F[3:]),
        ca.cross(V[:3], F[3:]),
    )


def spatial_inertia(mass: Expression, centre: np.ndarray, inertia_at_centre: Expression) -> Expression:
    """6 x 6 inertia in a frame in which the centre of mass lies at `centre` [m].

    `inertia_at_centre` [kg m2] is about the centre of mass, along the frame's axes.
    """
    c = ca.DM(skew(centre))
    return ca.vertcat(
        ca.horzcat(inertia_at_centre - mass * ca.sparsify(c @ c), mass * ca.sparsify(c)),
        ca.horzcat(-mass * ca.sparsify(c), mass * ca.DM.eye(3)),
    )


def cylinder_inertia(axial: Expression, transverse: Expression, axis: np.ndarray) -> Expression:
    """3 x 3 inertia of a body of revolution about a constant unit axis."""
    along = ca.sparsify(ca.DM(np.outer(axis, axis)))
    return transverse * ca.DM.eye(3) + (axial - transverse) * along
