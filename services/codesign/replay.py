"""Replay: a motion's voltages through an accurate integrator that knows nothing of the transcription.

The arm by the corrected Algorithm 1, the currents by eq. (1) as they stand, and beside them the energies as
quadratures  (MODEL section 5); energy that flows back has kinks and is integrated afterwards (`pieces`). Steps start
afresh at every interval, where the voltages jump or have a kink. They are explicit, of order 8, where that is cheap,
which is nearly always: an interval lasts some time constants of a winding. A stiff interval goes to CVODES (backward
differentiation of variable order and step, implicit).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from services.codesign.arm import build_arm
from services.codesign.collocation import DEGREES
from services.codesign.energy import kinetic_energy, potential_energy
from services.codesign.forward_dynamics import forward_dynamics
from services.codesign.friction import friction_torque
from services.codesign.kept import Kept
from services.codesign.kernels import build_library, default_cache, library_key
from services.codesign.motion import Motion, motors_of_design
from services.codesign.motor import MotorParameters, motor_torque, steady_voltages
from services.codesign.pieces import SHARES, Pieces, Samples, graded
from services.codesign.problem import Problem
from services.codesign.robot import Robot
from services.codesign.runge_kutta import FIRST_STEP, Stepper, step_function, steps_function
from services.codesign.voltage_law import VoltageLaw

Expression = Any

TOLERANCE = 1e-9
"""Absolute (rad, rad/s, A) and relative, of the integrators."""

ENERGY_TOLERANCE = 1e-8
"""Absolute (J, V2 s) and relative, of the quadratures of a step."""

SAMPLES = 20
"""Equal parts of each interval at whose ends the path is given, besides the motion's own points."""

STIFF_PIECES = 60
"""Into which an interval is cut that was crossed implicitly."""

QUADRATURES = 5
"""Electrical energy, copper loss, shaft's work, effort, friction's work."""

COEFFICIENTS = max(DEGREES) + 2
"""Of the voltage polynomial that the compiled plant takes; laws of lower degree are filled with zeros."""

FLAGS = ("-O2", "-march=native")
"""Of the plant: a third faster than the kernels' -O1, and no slower to compile."""

_SHAPING_SOURCES = (
    "arm.py",
    "energy.py",
    "forward_dynamics.py",
    "friction.py",
    "kernels.py",
    "mass_matrix.py",
    "motor.py",
    "replay.py",
    "robot.py",
    "runge_kutta.py",
    "spatial.py",
)


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


@dataclass(frozen=True)
class Plant:
    """The arm and its motors under given voltages, as functions; `slopes` integrates over an interval's share 0..1.

    - slopes: (share, state (4n,), parameters) -> (d state / d share, d quadratures / d share)
    - stepper: crosses intervals by `slopes`
    - energy: (q, qd, what is given) -> kinetic plus potential energy [J]
    """

    joints: int
    slopes: ca.Function
    stepper: Stepper
    energy: ca.Function


MOST_PLANTS = 16
"""Arms kept in a process."""

_PLANTS: Kept[Plant] = Kept(MOST_PLANTS)


def load_plant(robot: Robot, cache: Path | None = None) -> Plant:
    """An arm's functions, compiled where there is a compiler; kept in the process."""
    folder = default_cache() if cache is None else cache
    key = library_key(robot, ["replay", COEFFICIENTS], _SHAPING_SOURCES)
    return _PLANTS.get((key, folder), lambda: _load(robot, folder / f"{key}.so"))


def _load(robot: Robot, library: Path) -> Plant:
    if build_library(library, lambda: _functions(robot), more_flags=FLAGS):
        functions = {name: ca.external(name, str(library)) for name in ("slopes", "steps", "energy")}
    else:
        functions = _functions(robot)
    stepper = Stepper(functions["slopes"], functions["steps"])
    return Plant(robot.joints, functions["slopes"], stepper, functions["energy"])


def _functions(robot: Robot) -> dict[str, ca.Function]:
    n = robot.joints
    fields = len(MotorParameters._fields)
    share, x = ca.SX.sym("share"), ca.SX.sym("x", 4 * n)
    motors, gear_ratio = ca.SX.sym("motors", n, fields), ca.SX.sym("gear_ratio", n)
    payload, pole_pairs, width = ca.SX.sym("payload"), ca.SX.sym("pole_pairs"), ca.SX.sym("width")
    coefficients = ca.SX.sym("coefficients", 2 * n, COEFFICIENTS)
    given = ca.vertcat(ca.vec(motors), gear_ratio, payload, pole_pairs)
    p = ca.vertcat(given, width, ca.vec(coefficients))

    motor = MotorParameters(*ca.horzsplit(motors))
    rows = [MotorParameters(*ca.horzsplit(row)) for row in ca.vertsplit(motors)]
    arm = build_arm(robot, rows, payload, gear_ratio)
    q, qd, i_d, i_q = ca.vertsplit(x, n)
    u = coefficients[:, -1]
    for k in reversed(range(COEFFICIENTS - 1)):
        u = coefficients[:, k] + share * u
    u_d, u_q = ca.vertsplit(u, n)

    # Eq. (1) for the rates of the currents, Algorithm 1 for the acceleration
    torque, omega = motor_torque(i_q, motor, pole_pairs), gear_ratio * qd
    steady_d, steady_q = steady_voltages(i_d, i_q, omega, motor, pole_pairs)
    qdd = forward_dynamics(arm, q, qd, gear_ratio * torque)
    rates = width * ca.vertcat(qd, qdd, (u_d - steady_d) / motor.inductance, (u_q - steady_q) / motor.inductance)
    power = 1.5 * (u_d * i_d + u_q * i_q)
    copper = 1.5 * motor.phase_resistance * (i_d**2 + i_q**2)
    friction = ca.densify(ca.dot(friction_torque(arm, qd), qd))
    quadratures = width * ca.vertcat(ca.sum1(power), ca.sum1(copper), ca.dot(torque, omega), ca.dot(u, u), friction)
    energy = kinetic_energy(arm, q, qd) + potential_energy(arm, q)
    slopes = ca.Function("slopes", [share, x, p], [rates, quadratures], {"cse": True})
    return {
        "slopes": slopes,
        "steps": steps_function(step_function(slopes, TOLERANCE, ENERGY_TOLERANCE)),
        "jac_slopes": _jacobian(share, x, p, rates, quadratures),
        "energy": ca.Function("energy", [q, qd, given], [energy], {"cse": True}),
    }


def _jacobian(
    share: Expression, x: Expression, p: Expression, rates: Expression, quadratures: Expression
) -> ca.Function:
    """What CasADi looks for beside a compiled function, by its name: all blocks of the Jacobian.

    Newton's method asks for the one of the rates in the state; the others stay empty.
    """
    blocks = [
        ca.jacobian(rates, x) if output is rates and argument is x else ca.SX(output.shape[0], argument.shape[0])
        for output in (rates, quadratures)
        for argument in (share, x, p)
    ]
    results = [ca.SX.sym(f"result_{k}", output.shape[0]) for k, output in enumerate((rates, quadratures))]
    return ca.Function("jac_slopes", [share, x, p, *results], blocks, {"cse": True})


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


def cross_implicitly(
    plant: Plant, state: np.ndarray, parameters: np.ndarray, share: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """States at shares (m, 4n) and the quadratures over an interval, by CVODES; RuntimeError when it gives up."""
    end = _integrator(plant, tuple(share.tolist()))(x0=state, p=parameters)
    return np.vstack([state, end["xf"].full().T]), end["qf"].full()[:, -1]


@lru_cache(maxsize=16)
def _integrator(plant: Plant, share: tuple[float, ...]) -> ca.Function:
    t, x = ca.MX.sym("t"), ca.MX.sym("x", 4 * plant.joints)
    p = ca.MX.sym("p", plant.slopes.size1_in(2))
    rates, quadratures = plant.slopes(t, x, p)
    system = {"t": t, "x": x, "p": p, "ode": rates, "quad": quadratures}
    # The energies count in the choice of steps: a fast motion of one joint turns over far more than its states show.
    options = {"abstol": TOLERANCE, "reltol": TOLERANCE, "quad_err_con": True}
    return ca.integrator("replay", "cvodes", system, 0, list(share[1:]), options)
