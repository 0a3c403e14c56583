"""The joint-space mass matrix by the composite-rigid-body algorithm (Featherstone 2008, table 6.2), with rotors."""

from __future__ import annotations

from typing import Any

import casadi as ca

from services.codesign.arm import Arm
from services.codesign.spatial import adjoint_to_child, wrench_to_parent

Expression = Any


def mass_matrix(arm: Arm, q: Expression) -> Expression:
    """M(q) of eq. (4), shape (n, n), kg m2, as the joints see it (rotors enter with Z and Z^2)."""
    n = arm.joints
    poses = [arm.pose(k, q) for k in range(n)]
    M = ca.SX(n, n)
    composite: Expression = ca.DM(6, 6)
    for k in reversed(range(n)):
        rotor_of_child = arm.rotor_inertia[k + 1] if k + 1 < n else 0
        composite = composite + arm.link_inertia[k] + rotor_of_child
        Z, J = arm.gear_ratio[k], arm.rotor_inertia_axial[k]
        F = composite @ arm.joint_screw(k)
        M[k, k] = ca.dot(arm.axes[k], F[:3]) + J * Z**2
        # The rotor spins with joint k but is carried by link k-1: its momentum joins the wrench there.
        F = wrench_to_parent(F, *poses[k]) + ca.vertcat(J * Z * ca.DM(arm.axes[k]), ca.DM(3, 1))
        for j in reversed(range(k)):
            M[j, k] = M[k, j] = ca.dot(arm.axes[j], F[:3])
            F = wrench_to_parent(F, *poses[j])
        X = adjoint_to_child(*poses[k])
        composite = X.T @ composite @ X
    return M
