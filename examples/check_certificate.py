"""Check a motion's certificate from the JSON alone: its own motor, arm and integrator, none of the service's code.

    python examples/check_certificate.py http://127.0.0.1:8000/v1/applications/ID TASK [METHOD]
    python examples/check_certificate.py inputs.json task.json trajectory.json

The three files are what the service answers at `.../inputs`, `.../tasks/TASK` and `.../tasks/TASK/trajectory`.
The voltages of the trajectory drive the arm through scipy's LSODA; what comes out is compared with the certificate.
"""

from __future__ import annotations

import json
import sys
import urllib.request
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

TOLERANCE = 1e-10
"""Of the integrator, absolute and relative."""

SAMPLES = 40
"""Looks at the replay in every interval; the service looks at other times, so peaks differ a little."""

MM = 1e-3
MU_0 = 4e-7 * np.pi
PAYLOAD_RADIUS = 0.05  # m
FRICTION_SPEED = 0.05  # rad/s, within which Coulomb friction changes its sign

CONSTANTS = {
    "pole_pairs": 4,
    "slots": 12,
    "phases": 3,
    "turns_per_tooth": 50,
    "parallel_coils": 1,
    "tooth_tip_height_mm": 2.0,
    "air_gap_mm": 0.5,
    "magnet_arc_rad": np.pi,
    "remanent_flux_density_T": 1.38,
    "recoil_permeability": 1.05,
    "filling_factor": 0.55,
    "iron_density_kg_m3": 7650.0,
    "copper_density_kg_m3": 8960.0,
    "copper_resistivity_ohm_m": 1.8e-8,
    "current_limit_A": 3.0,
    "voltage_limit_V": 100.0,
}
"""What an application's `motor` leaves out has the paper's value."""


# ---- the motors: docs/model.md, section 2


@dataclass(frozen=True)
class Motors:
    """Arrays over the joints, SI."""

    resistance: np.ndarray
    inductance: np.ndarray
    flux: np.ndarray
    stator_mass: np.ndarray
    stator_axial: np.ndarray
    stator_transverse: np.ndarray
    rotor_mass: np.ndarray
    rotor_axial: np.ndarray
    rotor_transverse: np.ndarray


def motors(design_mm: np.ndarray, c: dict[str, Any]) -> Motors:
    """From the seven lengths of every motor, shape (n, 7), mm."""
    L, R_ro, R_so, h_m, h_sy, w_tooth, b_0 = design_mm.T * MM
    Q, P, n_s, C = c["slots"], c["pole_pairs"], c["turns_per_tooth"], c["parallel_coils"]
    h_tip, delta = c["tooth_tip_height_mm"] * MM, c["air_gap_mm"] * MM
    q_1 = Q // 3
    slot_height = R_so - h_sy - R_ro - delta - h_tip
    A_slot = np.pi * ((R_so - h_sy) ** 2 - (R_ro + delta + h_tip) ** 2) / Q - w_tooth * slot_height
    A_cu = c["filling_factor"] * A_slot
    A_coil = A_cu / (2 * n_s)
    L_end = (w_tooth * (2 - np.pi / 2) + np.pi * (2 * np.pi * (R_ro + delta) / Q) / 2) / 2
    L_coil = 2 * L + 2 * L_end
    rotor_mass = c["iron_density_kg_m3"] * np.pi * R_ro**2 * L
    stator_mass = (
        c["iron_density_kg_m3"] * (np.pi * (R_so**2 - R_ro**2) * L - A_cu * L * Q)
        + c["copper_density_kg_m3"] * A_coil * L_coil * n_s * Q
    )
    pitch = 2 * np.pi * R_ro / Q
    gamma = (b_0 / delta) ** 2 / (5 + b_0 / delta)
    carter = pitch / (pitch - gamma * delta)
    magnet = h_m / c["recoil_permeability"]
    B_g1 = 4 / np.pi * c["remanent_flux_density_T"] * magnet / (magnet + delta * carter)
    B_g1 = B_g1 * np.sin(c["magnet_arc_rad"] / 2)
    arc = 2 * np.pi / Q if (Q, P) == (12, 4) else 2 / P
    q = q_1 // np.gcd(q_1, 2 * P)
    winding_factor = abs(np.sin(np.pi * P / Q)) * np.sin(np.pi / 6) / (q * np.sin(np.pi / (6 * q)))
    permeance = MU_0 * L * (pitch / (delta + magnet) + 3 * h_tip / b_0 + 6 / np.pi)
    return Motors(
        resistance=q_1 / C**2 * n_s * c["copper_resistivity_ohm_m"] * L_coil / A_coil,
        inductance=q_1 / C**2 * n_s**2 * permeance,
        flux=q_1 / C * n_s * winding_factor * B_g1 * arc * R_ro * L,
        stator_mass=stator_mass,
        stator_axial=stator_mass * (R_ro**2 + R_so**2) / 2,
        stator_transverse=stator_mass * (3 * (R_ro**2 + R_so**2) + L**2) / 12,
        rotor_mass=rotor_mass,
        rotor_axial=rotor_mass * R_ro**2 / 2,
        rotor_transverse=rotor_mass * (3 * R_ro**2 + L**2) / 12,
    )


# ---- the arm: a tree of rigid bodies in the space frame, by Jacobians and the principle of virtual power


def skew(w: np.ndarray) -> np.ndarray:
    """[w] x = w cross x."""
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product along the last axis; numpy's own takes ten times as long for a few vectors."""
    x, y, z = np.moveaxis(a, -1, 0)
    u, v, w = np.moveaxis(b, -1, 0)
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


@dataclass(frozen=True)
class Body:
    """A rigid body at home: it moves with link `carrier` (-1: the base), and spins with joint `spins` if it is a rotor.

    A rotor is a body of revolution: its spin changes neither its centre nor its inertia about it.
    """

    carrier: int
    spins: int | None
    mass: float
    centre: np.ndarray
    inertia: np.ndarray  # about the centre, axes of the space frame


class Arm:
    """The robot with its motors and a payload. B bodies, n joints."""

    def __init__(self, robot: dict[str, Any], m: Motors, payload: float) -> None:
        self.axes = np.array(robot["screw_axes_space"])[:, :3]
        self.points = np.cross(self.axes, np.array(robot["screw_axes_space"])[:, 3:])
        self.K = np.array([skew(axis) for axis in self.axes])
        self.gears = np.array(robot["gear_ratio"])
        self.gravity = np.array(robot["gravity_m_s2"])
        self.n = len(self.gears)
        self.viscous = np.array(robot.get("viscous_friction_Nms_rad") or [0.0] * self.n)
        self.coulomb = np.array(robot.get("coulomb_friction_Nm") or [0.0] * self.n)
        bodies = list(self._bodies(robot, m, payload))
        self.carrier = np.array([body.carrier for body in bodies])
        self.mass = np.array([body.mass for body in bodies])
        self.centre = np.array([body.centre for body in bodies])
        self.inertia = np.array([body.inertia for body in bodies])
        self.carried = (np.arange(self.n) <= self.carrier[:, None]).astype(float)  # (B, n) which joints move a body
        self.spin = np.zeros((len(bodies), self.n))  # turns of a body about each joint's axis, relative to its carrier
        for number, body in enumerate(bodies):
            if body.spins is not None:
                self.spin[number, body.spins] = self.gears[body.spins]

    def _bodies(self, robot: dict[str, Any], m: Motors, payload: float) -> Any:
        position = np.array(robot["motor_position_home_m"])
        links = zip(robot["link_com_home"], robot["link_mass_kg"], robot["link_inertia_com_kg_m2"], strict=True)
        for k, (pose, mass, inertia) in enumerate(links):
            R = np.array(pose)[:3, :3]
            yield Body(k, None, mass, np.array(pose)[:3, 3], R @ np.array(inertia) @ R.T)
        for k, axis in enumerate(self.axes):
            along, across = np.outer(axis, axis), np.eye(3) - np.outer(axis, axis)
            stator = m.stator_axial[k] * along + m.stator_transverse[k] * across
            rotor = m.rotor_axial[k] * along + m.rotor_transverse[k] * across
            yield Body(k - 1, None, m.stator_mass[k], position[k], stator)
            yield Body(k - 1, k, m.rotor_mass[k], position[k], rotor)
        tool = np.array(robot["tool_home"])[:3, 3]
        yield Body(self.n - 1, None, payload, tool, 0.4 * payload * PAYLOAD_RADIUS**2 * np.eye(3))

    def _links(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rotations (n + 1, 3, 3) and translations (n + 1, 3) of the links away from home; the base last: index -1."""
        turns = np.eye(3) + np.sin(q)[:, None, None] * self.K + (1 - np.cos(q))[:, None, None] * self.K @ self.K
        R, p = np.eye(3), np.zeros(3)
        Rs, ps = [], []
        for turn, point in zip(turns, self.points, strict=True):
            p = p + R @ (point - turn @ point)
            R = R @ turn
            Rs.append(R)
            ps.append(p)
        return np.array([*Rs, np.eye(3)]), np.array([*ps, np.zeros(3)])

    def friction(self, qd: np.ndarray) -> np.ndarray:
        """Friction torques (n,) [N m]."""
        torque: np.ndarray = self.viscous * qd + self.coulomb * np.tanh(qd / FRICTION_SPEED)
        return torque

    def dynamics(self, q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """Mass matrix (n, n), the other torques (n,) [N m], and the potential energy [J].

        Of each body: velocities are J qd, accelerations J qdd + (dJ/dt) qd, and the joints feel J' of the forces.
        """
        Rs, ps = self._links(q)
        before = np.arange(self.n) - 1  # joint k's axis moves with link k - 1
        e = np.einsum("kij,kj->ki", Rs[before], self.axes)
        at = np.einsum("kij,kj->ki", Rs[before], self.points) + ps[before]
        omega = np.vstack([np.cumsum(e * qd[:, None], axis=0), np.zeros(3)])  # of the links, the base last
        e_dot = cross(omega[before], e)
        earlier = np.tril(np.ones((self.n, self.n)), -1)[:, :, None]
        at_dot = (earlier * cross(e[None], at[:, None] - at[None]) * qd[:, None]).sum(axis=1)

        R = Rs[self.carrier]
        c = np.einsum("bij,bj->bi", R, self.centre) + ps[self.carrier]
        inertia = R @ self.inertia @ R.transpose(0, 2, 1)
        arms, moved = c[:, None] - at, self.carried[:, :, None]  # (B, n, 3), (B, n, 1)
        J_v = moved * cross(e[None], arms)
        J_w = moved * e + self.spin[:, :, None] * e
        v = (J_v * qd[:, None]).sum(axis=1)
        a = (moved * (cross(e_dot[None], arms) + cross(e[None], v[:, None] - at_dot)) * qd[:, None]).sum(axis=1)
        alpha = (moved * e_dot * qd[:, None]).sum(axis=1)
        # The momentum of a body of revolution turns with its carrier, spin included.
        momentum = np.einsum("bij,bj->bi", inertia, (J_w * qd[:, None]).sum(axis=1))
        moment = np.einsum("bij,bj->bi", inertia, alpha) + cross(omega[self.carrier], momentum)
        force = self.mass[:, None] * (a - self.gravity)
        M = np.tensordot(self.mass[:, None, None] * J_v, J_v, ((0, 2), (0, 2)))
        M = M + np.tensordot(J_w @ inertia, J_w, ((0, 2), (0, 2)))
        h = np.einsum("bki,bi->k", J_v, force) + np.einsum("bki,bi->k", J_w, moment)
        return M, h, float(-(self.mass * (c @ self.gravity)).sum())


# ---- the replay


def check(inputs: dict[str, Any], task: dict[str, Any], trajectory: dict[str, Any]) -> dict[str, tuple[float, float]]:
    """Certificate figures by name: (recomputed here, reported)."""
    given = inputs["tasks"][trajectory["task"]]
    gears = trajectory.get("gear_ratio") or inputs["robot"]["gear_ratio"]  # the design's, where they were free
    robot = inputs["robot"] | {"gear_ratio": gears}
    constants = CONSTANTS | {name: value for name, value in inputs["motor"].items() if value is not None}
    m = motors(np.array(trajectory["design_mm"]), constants)
    arm = Arm(robot, m, given["payload_kg"])
    n, P = arm.n, constants["pole_pairs"]

    control = trajectory["control"]
    breaks = np.array(control["breaks_s"])
    u_d, u_q = np.array(control["voltage_d_V"]), np.array(control["voltage_q_V"])  # (interval, power, joint)

    def slopes(t: float, x: np.ndarray, w: int) -> np.ndarray:
        q, qd, i_d, i_q = x[: 4 * n].reshape(4, n)
        s = (t - breaks[w]) / (breaks[w + 1] - breaks[w])
        powers = s ** np.arange(u_d.shape[1])
        v_d, v_q, speed = powers @ u_d[w], powers @ u_q[w], arm.gears * qd
        torque = 1.5 * P * m.flux * i_q
        M, h, _ = arm.dynamics(q, qd)
        friction = arm.friction(qd)
        qdd = np.linalg.solve(M, arm.gears * torque - h - friction)
        di_d = (v_d - m.resistance * i_d + P * speed * m.inductance * i_q) / m.inductance
        di_q = (v_q - m.resistance * i_q - P * speed * (m.inductance * i_d + m.flux)) / m.inductance
        power = 1.5 * (v_d * i_d + v_q * i_q)
        copper = 1.5 * m.resistance * (i_d**2 + i_q**2)
        recovered = np.maximum(-power, 0).sum()
        energies = [power.sum(), copper.sum(), torque @ speed, v_d @ v_d + v_q @ v_q, recovered, friction @ qd]
        return np.concatenate([qd, qdd, di_d, di_q, energies])

    start_speed = given.get("start_speed_rad_s") or [0.0] * n
    x = np.concatenate([given["start_rad"], start_speed, np.zeros(2 * n), np.zeros(6)])
    first = x
    path = []
    for w in range(len(breaks) - 1):
        times = np.linspace(breaks[w], breaks[w + 1], SAMPLES + 1)
        found = solve_ivp(
            slopes, (breaks[w], breaks[w + 1]), x, "LSODA", times, args=(w,), rtol=TOLERANCE, atol=TOLERANCE
        )
        if not found.success:
            raise SystemExit(f"the replay stopped in interval {w + 1}: {found.message}")
        x = found.y[:, -1]
        path.append(found.y)
    states = np.stack(path)[:, : 4 * n].reshape(len(path), 4, n, -1)

    certificate = result_of(task, trajectory["method"])["certificate"]
    end_speed = given.get("end_speed_rad_s") or [0.0] * n
    energy = dict(zip(("input", "copper", "shaft", "effort", "recovered", "friction"), x[4 * n :], strict=True))
    field = 0.75 * m.inductance @ (x[2 * n : 3 * n] ** 2 + x[3 * n : 4 * n] ** 2)
    mechanical = _mechanical(arm, x, n) - _mechanical(arm, first, n)
    electrical = certificate["energy_balance"]["electrical"]
    result = result_of(task, trajectory["method"])
    reported = {
        "replay_position_rad": (np.abs(x[:n] - given["end_rad"]).max(), certificate["replay_position_rad"]),
        "replay_speed_rad_s": (np.abs(x[n : 2 * n] - end_speed).max(), certificate["replay_speed_rad_s"]),
        "input_J": (energy["input"], electrical["input_J"]),
        "copper_J": (energy["copper"], electrical["copper_J"]),
        "field_change_J": (field, electrical["field_change_J"]),
        "shaft_J": (energy["shaft"], electrical["shaft_J"]),
        "kinetic_and_potential_change_J": (
            mechanical,
            certificate["energy_balance"]["mechanical"]["kinetic_and_potential_change_J"],
        ),
        "friction_J": (energy["friction"], certificate["energy_balance"]["mechanical"]["friction_J"]),
        "energy_V2s": (energy["effort"], result["energy_V2s"]),
        "recovered_energy_J": (energy["recovered"], sum(result["recovered_energy_J"])),
    }
    excess = _excess(robot, constants, arm, states, (u_d, u_q))
    reported |= {f"{k} exceeded": (value, certificate["limits"][k]["between_points"]) for k, value in excess.items()}
    return {name: (float(here), float(there)) for name, (here, there) in reported.items()}


def result_of(task: dict[str, Any], method: str) -> dict[str, Any]:
    """The result of a task's motion: its own, or a method's."""
    found: dict[str, Any] = task["own"] if method == "own" else task["methods"][method]
    return found


def _mechanical(arm: Arm, x: np.ndarray, n: int) -> float:
    M, _, potential = arm.dynamics(x[:n], x[n : 2 * n])
    return float(x[n : 2 * n] @ M @ x[n : 2 * n] / 2 + potential)


def _excess(
    robot: dict[str, Any], c: dict[str, Any], arm: Arm, states: np.ndarray, voltages: tuple[np.ndarray, np.ndarray]
) -> dict[str, float]:
    """Largest excess over each limit, as a share of it; `states` is (intervals, 4, n, samples)."""
    low, high = np.array(robot["joint_position_limit_rad"]).T[:, :, None]
    position, speed, i_d, i_q = states.transpose(1, 0, 2, 3)
    powers = np.linspace(0, 1, SAMPLES + 1)[:, None] ** np.arange(voltages[0].shape[1])
    u = [np.einsum("sk,wkn->wns", powers, coefficients) for coefficients in voltages]
    rotor = np.abs(arm.gears)[:, None] * np.abs(speed)
    given = robot.get("joint_speed_limit_rad_s") or [None] * arm.n
    joint_limit = np.array([np.inf if limit is None else limit for limit in given])[:, None]
    shares = {
        "joint_range": np.maximum(low - position, position - high) / (high - low),
        "rotor_speed": np.maximum(rotor / robot["rotor_speed_limit_rad_s"], np.abs(speed) / joint_limit) - 1,
        "current": np.maximum(np.abs(i_d), np.abs(i_q)) / c["current_limit_A"] - 1,
        "voltage": np.maximum(*np.abs(u)) / c["voltage_limit_V"] - 1,
    }
    return {name: max(float(share.max()), 0.0) for name, share in shares.items()}


def _get(url: str) -> dict[str, Any]:
    with urllib.request.urlopen(url) as answer:
        found: dict[str, Any] = json.load(answer)
    return found


def main(arguments: list[str]) -> None:
    """Read, check, print."""
    if arguments and arguments[0].startswith("http"):
        base, task, *method = arguments
        query = f"?method={method[0]}" if method else ""
        where = f"{base}/tasks/{task}"
        answers = [_get(f"{base}/inputs"), _get(where), _get(f"{where}/trajectory{query}")]
    elif len(arguments) == 3:
        answers = [json.loads(Path(name).read_text(encoding="utf-8")) for name in arguments]
    else:
        raise SystemExit(__doc__)
    print(f"{'':34} {'here':>14} {'certificate':>14}")
    for name, (here, there) in check(*answers).items():
        print(f"{name:34} {here:14.6g} {there:14.6g}")


if __name__ == "__main__":
    main(sys.argv[1:])
