"""Friction at the joints: viscous, and Coulomb in a smooth form: departure 13 (docs/model.md)."""

from __future__ import annotations

from typing import Any

import casadi as ca

from services.codesign.arm import Arm

Expression = Any

TURNING_SPEED = 0.05
"""Joint speed [rad/s] within which Coulomb friction changes its sign: at twice this it has 96 percent of its size."""


def friction_torque(arm: Arm, qd: Expression) -> Expression:
    """What friction takes from the joint torques, b qd + c tanh(qd / v_s) [N m], shape (n,).

    Exactly zero, and no part of the expressions, where a joint has none. At rest it holds nothing: a smooth law has
    no stiction.
    """
    torques = []
    for k in range(arm.joints):
        torque: Expression = ca.SX(1, 1)
        if arm.viscous_friction[k] > 0:
            torque = torque + arm.viscous_friction[k] * qd[k]
        if arm.coulomb_friction[k] > 0:
            torque = torque + arm.coulomb_friction[k] * ca.tanh(qd[k] / TURNING_SPEED)
        torques.append(torque)
    return ca.vertcat(*torques)
