"""What gravity asks of the joints along the straight path, against the most that a motor can give."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from services.codesign.guess import motor_demand, starting_design
from services.codesign.instance import Instance
from services.codesign.motion import motors_of_design
from services.codesign.motor import motor_torque
from services.codesign.problem import Problem
from services.codesign.program import Program
from services.codesign.strongest_motor import strongest_torque

POINTS = 21
"""Where along the motion the torque is looked at."""


@dataclass(frozen=True)
class TorqueLoad:
    """Per joint, shape (n,), on the link side of the gears."""

    needed: np.ndarray  # N m, largest to hold still along the straight path, with the motors of the starting design
    available: np.ndarray  # N m at the current limit: of the given design, or of the strongest motor in the bounds

    @property
    def joint(self) -> int:
        """The joint, 0..n-1, that is asked for the largest share."""
        return int(np.argmax(self.needed / self.available))

    @property
    def share(self) -> float:
        """The largest share over the joints."""
        return float((self.needed / self.available).max())


def torque_load(problem: Problem, program: Program, instance: Instance) -> TorqueLoad:
    """Holding torques along the straight line from start to end.

    A share above 1 is no proof: the arm may fold a joint on its way, or swing.
    """
    design, gear_ratio = starting_design(problem), np.abs(problem.robot.gear_ratio)
    share = np.linspace(0, 1, POINTS)[:, None]
    path = problem.task.start + share * (problem.task.end - problem.task.start)
    still = np.zeros_like(path)
    i_q, _, _ = motor_demand(problem, program, instance, design, (path, still, still))
    motors = motors_of_design(design, problem)
    given = gear_ratio * motor_torque(problem.motor.current_limit, motors, problem.motor.pole_pairs)
    available = gear_ratio * strongest_torque(problem.motor) if problem.design is None else given
    return TorqueLoad(needed=np.abs(i_q).max(axis=0) * given, available=available)  # i_q is a share of its limit
