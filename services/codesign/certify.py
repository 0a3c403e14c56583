"""The certificate of a motion: what was found when its voltages were replayed, and how nearly it is optimal.

Nothing here is read from the solver or the transcription's own books  (MODEL section 5).
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from services.codesign.measures import Load, load_between_points
from services.codesign.motion import Motion
from services.codesign.pieces import Samples
from services.codesign.problem import Accuracy, Problem
from services.codesign.replay import Energies, Replay, ReplayError, replay
from services.codesign.solution import Solution
from services.codesign.voltage_law import VoltageLaw, voltage_law

LIMITS = ("joint_range", "rotor_speed", "current", "voltage")
"""Path limits (3a), (3b), (5a)-(5c), by kind."""

Excess = dict[str, np.ndarray]
"""Over each kind of limit, as a share of it, at every place and joint; below 0 where it is kept."""

BALANCE_TOLERANCE = 1e-6
"""Part of the energy turned over by which a balance may stay open: the integrator's errors come to 1e-7."""

BALANCE_FLOOR = 1e-6
"""J by which any balance may stay open: an arm that hardly moves turns nothing over."""


@dataclass(frozen=True)
class LimitCheck:
    """How far one kind of limit is exceeded, as a share of the limit (of the range for joints); 0 when it is kept."""

    at_points: float  # by the motion, at its grid points
    between_points: float  # by the replay, everywhere (`pieces.Pieces.extremes`)


@dataclass(frozen=True)
class EnergyBalance:
    """What is left of an energy balance over the replay, beside the largest term's size."""

    residual: float  # J
    turned_over: float  # J, sum of the sizes of the terms

    @property
    def closed(self) -> bool:
        """Whether the residual is within `BALANCE_TOLERANCE` of what was turned over, or within `BALANCE_FLOOR`."""
        return abs(self.residual) <= max(BALANCE_TOLERANCE * self.turned_over, BALANCE_FLOOR)


@dataclass(frozen=True)
class Growth:
    """Where the errors come from: per interval, shape (N,), largest over the joints."""

    position: np.ndarray  # rad, change over the interval of the difference between replay and motion
    speed: np.ndarray  # rad/s, the same
    excess: np.ndarray  # share of a limit, largest over the limits, by the replay within the interval


@dataclass(frozen=True)
class Certificate:
    """What is known of a motion. Replay figures are the largest over the joints; None when the replay broke off."""

    replay_position: float | None  # rad, at t_f, to the task's end
    replay_speed: float | None  # rad/s, at t_f, to the task's end
    path_position: float | None  # rad, to the motion, largest over its grid points
    path_speed: float | None  # rad/s, the same
    limits: Mapping[str, LimitCheck]  # by `LIMITS`; without a replay, between_points is infinite
    electrical_balance: EnergyBalance | None  # input = copper + field change + shaft
    mechanical_balance: EnergyBalance | None  # shaft = change of kinetic and potential energy + friction
    energies: Energies | None
    load: Load | None  # of the motors, over the replay
    kkt_residual: float  # scaled; from the program's functions with the multipliers
    constraint_violation: float  # scaled; of the program at the solution
    law: VoltageLaw
    growth: Growth | None
    seconds: float = 0.0  # it took

    @property
    def limit_violation(self) -> float:
        """Largest over all limits, at the grid points and between them, as a share of the limit."""
        return max(max(check.at_points, check.between_points) for check in self.limits.values())

    @property
    def balanced(self) -> bool:
        """Whether both energy balances are closed; without a replay neither is."""
        balances = (self.electrical_balance, self.mechanical_balance)
        return all(balance is not None and balance.closed for balance in balances)

    def meets(self, accuracy: Accuracy) -> bool:
        """Whether the motion keeps `accuracy`, and the replay that says so accounts for all energy."""
        return self.keeps(accuracy) and self.balanced

    def keeps(self, accuracy: Accuracy) -> bool:
        """Whether the replay ends within the tolerances, and no limit is exceeded by more than allowed."""
        if self.replay_position is None or self.replay_speed is None:
            return False
        at_end = self.replay_position <= accuracy.position and self.replay_speed <= accuracy.speed
        return at_end and self.limit_violation <= accuracy.limit


def certify(solution: Solution) -> Certificate:
    """Replay a solved motion and write down what is found.

    Raises
    ------
    ValueError
        For a failed solve.
    """
    problem, design, motion = solution.problem, solution.design, solution.motion
    if design is None or motion is None:
        raise ValueError(f"a failed solve ({solution.status}) has no certificate")
    began = time.perf_counter()
    law = voltage_law(problem, design, motion)
    try:
        found = replay(problem, design, motion, law)
    except ReplayError:
        found = None
    excess = None if found is None else _excess(problem, *found.pieces.extremes)
    end = _end_errors(problem, found)
    path = _path_errors(problem, motion, found)
    return Certificate(
        replay_position=end[0],
        replay_speed=end[1],
        path_position=path[0],
        path_speed=path[1],
        limits=_limit_checks(problem, motion, excess),
        electrical_balance=None if found is None else _electrical_balance(found.energies),
        mechanical_balance=None if found is None else _mechanical_balance(found.energies),
        energies=None if found is None else found.energies,
        load=None if found is None else load_between_points(problem, design, found.pieces),
        kkt_residual=solution.kkt_residual,
        constraint_violation=solution.constraint_violation,
        law=law,
        growth=None if found is None or excess is None else _growth(problem, motion, found, excess),
        seconds=time.perf_counter() - began,
    )


def _end_errors(problem: Problem, found: Replay | None) -> tuple[float | None, float | None]:
    if found is None:
        return None, None
    task = problem.task
    return _largest(found.position[-1, -1] - task.end), _largest(found.speed[-1, -1] - task.end_velocity)


def _path_errors(problem: Problem, motion: Motion, found: Replay | None) -> tuple[float | None, float | None]:
    """At the motion's grid points, all of which are among the replay's samples."""
    if found is None:
        return None, None
    layout = problem.layout
    inside = np.concatenate([layout.collocation.points, [1.0]])[: layout.stops]
    places = np.abs(found.share[:, None] - inside).argmin(axis=0)
    n = problem.robot.joints
    position, speed = (x[:, places].reshape(-1, n) for x in (found.position, found.speed))
    return _largest(position - motion.position[1:]), _largest(speed - motion.speed[1:])


def _limit_checks(problem: Problem, motion: Motion, excess: Excess | None) -> dict[str, LimitCheck]:
    at_points = _largest_excess(_excess(problem, motion, motion))
    between = dict.fromkeys(LIMITS, math.inf) if excess is None else _largest_excess(excess)
    return {kind: LimitCheck(at_points[kind], between[kind]) for kind in LIMITS}


def _growth(problem: Problem, motion: Motion, found: Replay, excess: Excess) -> Growth:
    ends = slice(problem.layout.stops, None, problem.layout.stops)

    def over_interval(replayed: np.ndarray, planned: np.ndarray) -> np.ndarray:
        difference = replayed[:, -1] - planned[ends]
        change: np.ndarray = np.abs(np.diff(difference, axis=0, prepend=0)).max(axis=1)
        return change

    of_pieces = np.max([share.max(axis=1) for share in excess.values()], axis=0)
    starts = np.searchsorted(found.pieces.interval, np.arange(problem.transcription.intervals))
    return Growth(
        position=over_interval(found.position, motion.position),
        speed=over_interval(found.speed, motion.speed),
        excess=np.maximum(np.maximum.reduceat(of_pieces, starts), 0.0),
    )


def _largest_excess(excess: Excess) -> dict[str, float]:
    """0 where a kind of limit is kept."""
    return {kind: max(float(share.max()), 0.0) for kind, share in excess.items()}


def _excess(problem: Problem, lowest: Motion | Samples, highest: Motion | Samples) -> Excess:
    """From the extremes at every place; they are one where a place is a point."""
    robot, motor = problem.robot, problem.motor
    outside = np.maximum(robot.joint_lower - lowest.position, highest.position - robot.joint_upper)

    def size(quantity: str) -> np.ndarray:
        largest: np.ndarray = np.maximum(-getattr(lowest, quantity), getattr(highest, quantity))
        return largest

    return {
        "joint_range": outside / (robot.joint_upper - robot.joint_lower),
        "rotor_speed": size("speed") / robot.joint_speed_limit - 1,
        "current": np.maximum(size("current_d"), size("current_q")) / motor.current_limit - 1,
        "voltage": np.maximum(size("voltage_d"), size("voltage_q")) / motor.voltage_limit - 1,
    }


def _electrical_balance(e: Energies) -> EnergyBalance:
    terms = (e.electrical, -e.copper, -e.field_change, -e.shaft)
    return EnergyBalance(sum(terms), sum(map(abs, terms)))


def _mechanical_balance(e: Energies) -> EnergyBalance:
    terms = (e.shaft, -e.mechanical_change, -e.friction)
    return EnergyBalance(sum(terms), sum(map(abs, terms)))


def _largest(values: np.ndarray) -> float:
    return float(np.abs(values).max())
