"""The arm and its motors under given voltages, as compiled functions: what a replay integrates.

The arm by the corrected Algorithm 1, the currents by eq. (1) as they stand, and beside them the energies as
quadratures (MODEL section 5).
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
from services.codesign.motor import MotorParameters, motor_torque, steady_voltages
from services.codesign.robot import Robot
from services.codesign.runge_kutta import Stepper, step_function, steps_function

Expression = Any

TOLERANCE = 1e-9
"""Absolute (rad, rad/s, A) and relative, of the integrators."""

ENERGY_TOLERANCE = 1e-8
"""Absolute (J, V2 s) and relative, of the quadratures of a step."""

QUADRATURES = 5
"""Electrical energy, copper loss, shaft's work, effort, friction's work."""

COEFFICIENTS = max(DEGREES) + 2
"""Of the voltage polynomial that the compiled plant takes; laws of lower degree are filled with zeros."""

FLAGS = ("-O2", "-march=native")
"""Of the plant: a third faster than the kernels' -O1, and no slower to compile."""


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
    key = plant_key(robot)
    return _PLANTS.get((key, folder), lambda: _load(robot, folder / f"{key}.so"))


def plant_key(robot: Robot) -> str:
    """Hash of everything that shapes the code."""
    return library_key(robot, ["plant", FLAGS], "plant")


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
