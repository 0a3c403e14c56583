"""Mechanical energy of the arm, rotors included: the state function of the second balance  (MODEL section 5)."""

from __future__ import annotations

from typing import Any

import casadi as ca

from services.codesign.arm import Arm
from services.codesign.mass_matrix import mass_matrix

Expression = Any


def kinetic_energy(arm: Arm, q: Expression, qd: Expression) -> Expression:
    """1/2 qd' M(q) qd [J]: links, stators, payload and the rotors at their own speed  (eq. 4)."""
    return ca.dot(qd, mass_matrix(arm, q) @ qd) / 2


def potential_energy(arm: Arm, q: Expression) -> Expression:
    """-sum m g'c [J] over the bodies that move, c from the origin of the space frame; rotor 1 stays where it is."""
    R: Expression = ca.SX.eye(3)
    p: Expression = ca.SX(3, 1)
    energy: Expression = 0
    for k in range(arm.joints):
        R_k, p_k = arm.pose(k, q)
        R, p = R @ R_k, p + R @ ca.DM(p_k)
        carried = arm.link_inertia[k] + (arm.rotor_inertia[k + 1] if k + 1 < arm.joints else 0)
        energy = energy - _weight_moment(arm, carried, R, p)
    return energy


def _weight_moment(arm: Arm, inertia: Expression, R: Expression, p: Expression) -> Expression:
    """g'(m p + R m c) of a body with a 6 x 6 inertia in a frame (R, p); its blocks are m [c] and m 1."""
    first_moment = ca.vertcat(inertia[2, 4], inertia[0, 5], inertia[1, 3])
    return ca.dot(ca.DM(arm.gravity), inertia[3, 3] * p + R @ first_moment)
