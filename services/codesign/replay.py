"""Replay: a motion's voltages through an accurate integrator that knows nothing of the transcription.

What is integrated is the `plant`; energy that flows back has kinks and is integrated afterwards (`pieces`). Steps start
afresh at every interval, where the voltages jump or have a kink. They are explicit, of order 8, where that is cheap,
which is nearly always: an interval lasts some time constants of a winding. A stiff interval goes to CVODES (backward
differentiation of variable order and step, implicit).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from services.codesign.motion import Motion, motors_of_design
from services.codesign.pieces import SHARES, Pieces, Samples, graded
from services.codesign.plant import COEFFICIENTS, QUADRATURES, Plant, cross_implicitly, load_plant
from services.codesign.problem import Problem
from services.codesign.runge_kutta import FIRST_STEP
from services.codesign.voltage_law import VoltageLaw

SAMPLES = 20
"""Equal parts of each interval at whose ends the path is given, besides the motion's own points."""

STIFF_PIECES = 60
"""Into which an interval is cut that was crossed implicitly."""


class ReplayError(RuntimeError):
    """The integrator gave up: a motion that cannot be followed to its end."""


@dataclass(frozen=True)
class Energies:
    """Over the whole replay, all motors together, in J unless said."""

    electrical: float  # 3/2 integral of (u_d i_d + u_q i_q), signed
    copper: float
    field_change: float  # of 3/4 L (i_d^2 + i_q^2)
    shaft: float  # integral of torque times rotor speed
    mechanical_change: float  # of kinetic and potential energy
    friction: float  # integral of friction torque times joint speed, >= 0
    recovered: np.ndarray  # (n,) per motor, >= 0: what flows back while its electrical power is negative
    effort: float  # integral of u'u [V2 s]


@dataclass(frozen=True)
class Replay:
    """States at `share` of each interval's length, arrays (N, m, n) in SI; share is 0 first, 1 last."""

    share: np.ndarray  # (m,)
    time: np.ndarray  # (N, m) s
    position: np.ndarray
    speed: np.ndarray
    current_d: np.ndarray
    current_q: np.ndarray
    pieces: Pieces  # states and voltages everywhere
    energies: Energies


def replay(problem: Problem, design: np.ndarray, motion: Motion, law: VoltageLaw) -> Replay:
    """Drive the arm with `law` from the motion's start; `design` has shape (n, 7) [m].

    Raises
    ------
    ReplayError
        When the integrator cannot reach the end.
    """
    n, N = problem.robot.joints, law.intervals
    plant = load_plant(problem.robot)
    share = _shares(problem.layout.collocation.points)
    given = _given(problem, design)
    coefficients = np.zeros((N, COEFFICIENTS, 2 * n))
    coefficients[:, : law.voltage_d.shape[1], :n] = law.voltage_d
    coefficients[:, : law.voltage_q.shape[1], n:] = law.voltage_q
    widths = np.diff(law.breaks)

    states, quadratures = np.empty((N, len(share), 4 * n)), np.zeros(QUADRATURES)
    pieces = []
    state = np.concatenate([motion.position[0], motion.speed[0], motion.current_d[0], motion.current_q[0]])
    step = FIRST_STEP
    for w in range(N):
        parameters = np.concatenate([given, [widths[w]], coefficients[w].ravel()])
        steps = plant.stepper.cross(state, quadratures, parameters, step)
        if steps is not None:
            states[w], state, quadratures, step = steps.at(share), steps.end, steps.totals, steps.next_step
            pieces.append((steps.ends, steps.within(SHARES)))
            continue
        try:
            states[w], piece, change = _cross_implicitly(plant, state, parameters, share)
        except RuntimeError as error:
            raise ReplayError(f"the integrator stopped in interval {w + 1} of {N}") from error
        state, quadratures = states[w, -1], quadratures + change
        pieces.append(piece)
    position, speed, current_d, current_q = np.split(states, 4, axis=2)
    change = _state_energies(plant, given, problem, design, state)
    change = change - _state_energies(plant, given, problem, design, states[0, 0])
    everywhere = _pieces(law, pieces)
    return Replay(
        share=share,
        time=law.breaks[:-1, None] + widths[:, None] * share,
        position=position,
        speed=speed,
        current_d=current_d,
        current_q=current_q,
        pieces=everywhere,
        energies=Energies(
            electrical=float(quadratures[0]),
            copper=float(quadratures[1]),
            field_change=float(change[0]),
            shaft=float(quadratures[2]),
            mechanical_change=float(change[1]),
            friction=float(quadratures[4]),
            recovered=everywhere.integral_below_zero(electrical_power(everywhere.nodes)),
            effort=float(quadratures[3]),
        ),
    )


def electrical_power(x: Samples) -> np.ndarray:
    """What each motor draws, 3/2 (u_d i_d + u_q i_q) [W]."""
    power: np.ndarray = 1.5 * (x.voltage_d * x.current_d + x.voltage_q * x.current_q)
    return power


def _pieces(law: VoltageLaw, found: list[tuple[np.ndarray, np.ndarray]]) -> Pieces:
    """From each interval's ends of pieces (k + 1,) and states within them (k, `NODES`, 4n)."""
    interval = np.repeat(np.arange(law.intervals), [len(ends) - 1 for ends, _ in found])
    starts = np.concatenate([ends[:-1] for ends, _ in found])
    shares = np.concatenate([np.diff(ends) for ends, _ in found])
    position, speed, current_d, current_q = np.split(np.concatenate([states for _, states in found]), 4, axis=2)
    voltage_d, voltage_q = law.within(interval, starts[:, None] + shares[:, None] * SHARES)
    nodes = Samples(position, speed, current_d, current_q, voltage_d, voltage_q)
    return Pieces(interval, shares * np.diff(law.breaks)[interval], nodes)


def _shares(points: np.ndarray) -> np.ndarray:
    """Equally spaced, and the collocation points; each once."""
    both = np.concatenate([np.linspace(0, 1, SAMPLES + 1), points])
    shares: np.ndarray = np.unique(np.round(both, 12))
    return shares


def _given(problem: Problem, design: np.ndarray) -> np.ndarray:
    """What stays the same over a motion: motor parameters, gears, payload, pole pairs."""
    motors = motors_of_design(design, problem)
    fixed = [problem.robot.gear_ratio, [problem.task.payload], [problem.motor.pole_pairs]]
    return np.concatenate([*motors, *fixed])


def _state_energies(
    plant: Plant, given: np.ndarray, problem: Problem, design: np.ndarray, state: np.ndarray
) -> np.ndarray:
    """Field energy, and kinetic plus potential energy [J], shape (2,)."""
    n = problem.robot.joints
    inductance = motors_of_design(design, problem).inductance
    field = 0.75 * float(inductance @ (state[2 * n : 3 * n] ** 2 + state[3 * n :] ** 2))
    return np.array([field, float(plant.energy(state[:n], state[n : 2 * n], given))])


def _cross_implicitly(
    plant: Plant, state: np.ndarray, parameters: np.ndarray, share: np.ndarray
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray], np.ndarray]:
    """States at shares, pieces, and the change of the quadratures."""
    ends = graded(STIFF_PIECES)
    inside = ends[:-1, None] + np.diff(ends)[:, None] * SHARES
    together, place = np.unique(np.round(np.concatenate([share, inside.ravel()]), 12), return_inverse=True)
    found, change = cross_implicitly(plant, state, parameters, together)
    states = found[place]
    return states[: len(share)], (ends, states[len(share) :].reshape(*inside.shape, -1)), change
