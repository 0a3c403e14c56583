"""Forward dynamics: the paper's Algorithm 1, corrected: departure 7 (docs/model.md)  (MODEL section 3).

Link k and rotor k share one joint coordinate. With U = X^T IA_L A_L + Z IA_R A_R the articulated inertia that the
parent receives loses U D U^T, cross terms between link and rotor included; the printed recursion drops those,
the transposes in `A p` and `ad V`, and never gives the rotor's acceleration. Here both bodies are kept, as printed.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from services.codesign.arm import Arm
from services.codesign.friction import friction_torque
from services.codesign.spatial import adjoint_to_child, bracket, bracket_dual

Expression = Any


def forward_dynamics(arm: Arm, q: Expression, qd: Expression, tau: Expression) -> Expression:
    """Joint accelerations [rad/s2] under joint torques `tau` [N m], shape (n,)  (Algorithm 1)."""
    n = arm.joints
    tau = tau - friction_torque(arm, qd)

    # ---- outward: transforms, twists, velocity products, bias forces of single bodies
    X, A_L, A_R, xi_L, p_L, p_R = (_per_joint(n) for _ in range(6))
    I_L: list[Expression] = list(arm.link_inertia)
    V_parent: Expression = ca.DM(6, 1)
    for k in range(n):
        X[k] = adjoint_to_child(*arm.pose(k, q))
        A_L[k] = arm.joint_screw(k)
        A_R[k] = arm.rotor_screw(k) * arm.gear_ratio[k]
        V_L = X[k] @ V_parent + A_L[k] * qd[k]
        # The rotor is seen in its carrier's frame, in which A_R is constant: it has no velocity product xi_R.
        V_R = V_parent + A_R[k] * qd[k]
        xi_L[k] = bracket(V_L, A_L[k] * qd[k])
        p_L[k] = bracket_dual(V_L, I_L[k] @ V_L)
        p_R[k] = _rotor_bias(arm, k, V_parent, V_R)
        V_parent = V_L

    # ---- inward: articulated inertias and bias forces
    D, mu = _per_joint(n), _per_joint(n)
    for k in reversed(range(n)):
        I_R = arm.rotor_inertia[k]
        U_L, U_R = I_L[k] @ A_L[k], I_R @ A_R[k]
        f_L = p_L[k] + I_L[k] @ xi_L[k]
        D[k] = 1 / (ca.dot(A_L[k], U_L) + ca.dot(A_R[k], U_R))
        mu[k] = tau[k] - ca.dot(A_L[k], f_L) - ca.dot(A_R[k], p_R[k])
        if k > 0:
            U = X[k].T @ U_L + U_R
            I_L[k - 1] = I_L[k - 1] + X[k].T @ I_L[k] @ X[k] + I_R - U @ (D[k] * U.T)
            p_L[k - 1] = p_L[k - 1] + X[k].T @ f_L + p_R[k] + U * (D[k] * mu[k])

    # ---- outward: accelerations
    V_dot: Expression = ca.vertcat(ca.DM(3, 1), ca.sparsify(ca.DM(-arm.gravity)))
    qdd = []
    for k in range(n):
        carried = X[k] @ V_dot
        U_L, U_R = I_L[k] @ A_L[k], arm.rotor_inertia[k] @ A_R[k]
        qdd_k = D[k] * (mu[k] - ca.dot(U_L, carried) - ca.dot(U_R, V_dot))
        V_dot = carried + A_L[k] * qdd_k + xi_L[k]
        qdd.append(qdd_k)
    return ca.vertcat(*qdd)


def _per_joint(n: int) -> list[Expression]:
    """Room for one expression a joint."""
    return [None] * n


def _rotor_bias(arm: Arm, k: int, V_carrier: Expression, V_R: Expression) -> Expression:
    """Bias wrench of rotor k in its carrier's frame: the frame turns with the carrier, the momentum is the rotor's.

    For a body of revolution the inertia is constant in that frame, so d(I V)/dt = I V-dot + ad*(V_carrier) I V.
    """
    return bracket_dual(V_carrier, arm.rotor_inertia[k] @ V_R)
