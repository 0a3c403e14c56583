"""What a motion costs and how hard it works the motors: the numbers reported with every result  (MODEL section 1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from services.codesign.motion import Motion, motors_of_design
from services.codesign.motor import motor_torque
from services.codesign.pieces import Pieces, Samples
from services.codesign.problem import Problem


@dataclass(frozen=True)
class Measures:
    """Integrals over the motion, on its own grid and quadrature; arrays over the joints have shape (n,)."""

    final_time: float  # s
    effort: float  # integral of u'u [V2 s]
    electrical_energy: float  # J, signed
    copper_loss: float  # J
    recovered_energy: np.ndarray  # J per motor, >= 0: what flows back while its electrical power is negative
    load: Load


@dataclass(frozen=True)
class Load:
    """Shares of the limits, 1 = at the limit, by quantity; each array has shape (n,)."""

    peaks: dict[str, np.ndarray]  # largest
    rms: dict[str, np.ndarray]  # root mean square over time


def measure(problem: Problem, design: np.ndarray, motion: Motion) -> Measures:
    """Integrate a motion made with `design`, shape (n, 7) [m]; peaks are those of its grid points alone."""
    motor, w = motors_of_design(design, problem), motion.weights[:, None]
    u_d, u_q, i_d, i_q = motion.voltage_d, motion.voltage_q, motion.current_d, motion.current_q
    power = 1.5 * (u_d * i_d + u_q * i_q)
    shares = _shares(problem, design, motion)
    return Measures(
        final_time=motion.final_time,
        effort=float(np.sum(w * (u_d**2 + u_q**2))),
        electrical_energy=float(np.sum(w * power)),
        copper_loss=float(np.sum(w * 1.5 * motor.phase_resistance * (i_d**2 + i_q**2))),
        recovered_energy=np.sum(w * np.maximum(-power, 0), axis=0),
        load=Load(
            peaks={name: np.abs(share).max(axis=0) for name, share in shares.items()},
            rms={name: np.sqrt(np.sum(w * share**2, axis=0) / motion.final_time) for name, share in shares.items()},
        ),
    )


def load_between_points(problem: Problem, design: np.ndarray, pieces: Pieces) -> Load:
    """What the motors really go through, over the whole replay.

    Voltages jump and currents swing between the grid points; the grid alone does not see it.
    """
    at_nodes = _shares(problem, design, pieces.nodes)
    lowest, highest = (_shares(problem, design, found) for found in pieces.extremes)
    duration = pieces.width.sum()
    return Load(
        peaks={name: np.maximum(-lowest[name], highest[name]).max(axis=0) for name in at_nodes},
        rms={name: np.sqrt(pieces.integral(share**2) / duration) for name, share in at_nodes.items()},
    )


def _shares(problem: Problem, design: np.ndarray, x: Motion | Samples) -> dict[str, np.ndarray]:
    """Every quantity as a share of its limit; the last axis is the joints."""
    motor, limits = motors_of_design(design, problem), problem.motor
    # Z times torque over Z times its limit: the gear drops out.
    torque, torque_limit = (motor_torque(i, motor, limits.pole_pairs) for i in (x.current_q, limits.current_limit))
    return {
        "current_d": x.current_d / limits.current_limit,
        "current_q": x.current_q / limits.current_limit,
        "voltage_d": x.voltage_d / limits.voltage_limit,
        "voltage_q": x.voltage_q / limits.voltage_limit,
        "joint_torque": torque / torque_limit,
        "rotor_speed": x.speed / problem.robot.joint_speed_limit,
    }
