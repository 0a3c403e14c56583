"""Inverse dynamics by the recursive Newton-Euler algorithm (Lynch & Park, section 8.3), with geared rotors.

A rotor is a body of revolution, so its mass and inertia ride with the link that carries it, and its spin adds only
an angular momentum J Z qd along the axis (a gyrostat). This is exact and halves the work of a 2n-body tree;
`forward_dynamics` keeps the rotors as bodies of their own and checks it.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from services.codesign.arm import Arm
from services.codesign.friction import friction_torque
from services.codesign.spatial import bracket, bracket_dual, motion_to_child, wrench_to_parent

Expression = Any


def inverse_dynamics(arm: Arm, q: Expression, qd: Expression, qdd: Expression) -> Expression:
    """Joint torques [N m], on the link side of the gears, that produce `qdd`  (eq. 4, inverted).

    Parameters
    ----------
    q, qd, qdd
        Shape (n,): rad, rad/s, rad/s2.

    Returns
    -------
    Expression
        Shape (n,); equals Z times the motor torques.
    """
    n = arm.joints
    zero = ca.DM(6, 1)
    V, V_dot = zero, ca.vertcat(ca.DM(3, 1), ca.sparsify(ca.DM(-arm.gravity)))
    poses, twists, accelerations, parent_spin_rate, parent_omega = [], [], [], [], []

    # ---- outward: twists and their rates, link by link
    for k in range(n):
        R, p = arm.pose(k, q)
        A = arm.joint_screw(k)
        parent_omega.append(V[:3])
        parent_spin_rate.append(ca.dot(arm.axes[k], V_dot[:3]))
        V = motion_to_child(V, R, p) + A * qd[k]
        V_dot = motion_to_child(V_dot, R, p) + A * qdd[k] + bracket(V, A * qd[k])
        poses.append((R, p))
        twists.append(V)
        accelerations.append(V_dot)

    # ---- inward: wrenches and joint torques
    tau: list[Expression] = [None] * n
    F_child = zero
    for k in reversed(range(n)):
        Z, J = arm.gear_ratio[k], arm.rotor_inertia_axial[k]
        G = arm.link_inertia[k] + (arm.rotor_inertia[k + 1] if k + 1 < n else 0)
        V, V_dot = twists[k], accelerations[k]
        F = G @ V_dot + bracket_dual(V, G @ V) + F_child
        tau[k] = ca.dot(arm.axes[k], F[:3]) + Z * J * (Z * qdd[k] + parent_spin_rate[k])
        spin_moment = J * Z * (arm.axes[k] * qdd[k] + ca.cross(parent_omega[k], ca.DM(arm.axes[k])) * qd[k])
        F_child = wrench_to_parent(F, *poses[k]) + ca.vertcat(spin_moment, ca.DM(3, 1))
    return ca.vertcat(*tau) + friction_torque(arm, qd)
