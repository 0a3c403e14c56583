"""What a motion costs and how hard it works the motors: the numbers reported with every result  (MODEL section 1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from services.codesign.motion import Motion, motors_of_design
from services.codesign.motor import motor_torque
from services.codesign.problem import Problem


@dataclass(frozen=True)
class Measures:
    """Integrals over the motion, on its own grid and quadrature; arrays over the joints have shape (n,)."""

    final_time: float  # s
    effort: float  # integral of u'u [V2 s]
    electrical_energy: float  # J, signed
    copper_loss: float  # J
    recovered_energy: np.ndarray  # J per motor, >= 0: what flows back while its electrical power is negative
    peaks: dict[str, np.ndarray]  # largest share of each limit, per joint
    rms: dict[str, np.ndarray]  # root mean square share of each limit, per joint


def measure(problem: Problem, design: np.ndarray, motion: Motion) -> Measures:
    """Integrate a motion made with `design`, shape (n, 7) [m]."""
    motor, limits, w = motors_of_design(design, problem), problem.motor, motion.weights[:, None]
    u_d, u_q, i_d, i_q = motion.voltage_d, motion.voltage_q, motion.current_d, motion.current_q
    power = 1.5 * (u_d * i_d + u_q * i_q)
    torque_limit = problem.robot.gear_ratio * motor_torque(limits.current_limit, motor, limits.pole_pairs)
    shares = {
        "current_d": i_d / limits.current_limit,
        "current_q": i_q / limits.current_limit,
        "voltage_d": u_d / limits.voltage_limit,
        "voltage_q": u_q / limits.voltage_limit,
        "joint_torque": motion.torque / torque_limit,
        "rotor_speed": motion.speed / problem.robot.joint_speed_limit,
    }
    return Measures(
        final_time=motion.final_time,
        effort=float(np.sum(w * (u_d**2 + u_q**2))),
        electrical_energy=float(np.sum(w * power)),
        copper_loss=float(np.sum(w * 1.5 * motor.phase_resistance * (i_d**2 + i_q**2))),
        recovered_energy=np.sum(w * np.maximum(-power, 0), axis=0),
        peaks={name: np.abs(share).max(axis=0) for name, share in shares.items()},
        rms={name: np.sqrt(np.sum(w * share**2, axis=0) / motion.final_time) for name, share in shares.items()},
    )
