"""Forward dynamics, inverse dynamics and mass matrix: against Pinocchio, against each other, against energy."""

from __future__ import annotations

import json
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm

from services.codesign.arm import build_arm
from services.codesign.motor import evaluate_motor
from services.codesign.motor_data import MotorData
from services.codesign.robot import Robot
from tests.numerics.arms import State, Tree, functions_of, random_robot, random_state

REFERENCE = json.loads((Path(__file__).parents[1] / "data" / "dynamics.json").read_text())

PINOCCHIO = 1e-9
"""Relative to the largest torque: two recursions in double precision; they differ by some 1e-14."""
IDENTITY = 1e-10
"""Relative to the largest acceleration. Forward after inverse dynamics is the identity up to rounding, amplified by
the spread of inertias along the arm (1e2 to 1e4)."""
DIFFERENCES = 1e-6
"""Relative: what central differences with steps of 1e-6 leave."""

ROBOTS = [Robot.preset("ur5"), Robot.preset("ur5_modern_robotics"), *(random_robot(n) for n in (1, 2, 7))]
CASES = [pytest.param(robot, seed, id=f"{robot.name}-{seed}") for robot in ROBOTS for seed in range(6)]


def worst(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def reference_state(sample) -> State:
    return State(
        design=np.array(sample["design_mm"]) * 1e-3,
        payload=sample["payload_kg"],
        gear_ratio=Robot.preset(REFERENCE["robot"]).gear_ratio,
        q=np.array(sample["q_rad"]),
        qd=np.array(sample["qd_rad_s"]),
        qdd=np.array(sample["qdd_rad_s2"]),
    )


@pytest.mark.parametrize("sample", REFERENCE["samples"])
def test_inverse_dynamics_equals_the_reference(sample):
    robot, state = Robot.preset(REFERENCE["robot"]), reference_state(sample)
    expected = np.array(sample["joint_torque_Nm"])
    assert worst(functions_of(robot).torques(state), expected) < PINOCCHIO
    assert worst(functions_of(robot).accelerations(state, expected), state.qdd) < PINOCCHIO


@pytest.mark.parametrize(("robot", "seed"), CASES)
def test_inverse_dynamics_equals_pinocchio(robot, seed):
    state = random_state(robot, seed)
    assert worst(functions_of(robot).torques(state), Tree(robot, state).torques(state)) < PINOCCHIO


@pytest.mark.parametrize(("robot", "seed"), CASES)
def test_mass_matrix_equals_pinocchio_and_is_symmetric_positive_definite(robot, seed):
    state = random_state(robot, seed)
    M = functions_of(robot).mass_matrix(state)
    assert worst(M, Tree(robot, state).mass_matrix(state)) < PINOCCHIO
    assert np.array_equal(M, M.T)
    assert np.linalg.eigvalsh(M).min() > 0


@pytest.mark.parametrize(("robot", "seed"), CASES)
def test_forward_dynamics_undoes_inverse_dynamics(robot, seed):
    state, arm = random_state(robot, seed), functions_of(robot)
    assert worst(arm.accelerations(state, arm.torques(state)), state.qdd) < IDENTITY


@pytest.mark.parametrize(("robot", "seed"), CASES)
def test_inverse_dynamics_is_mass_matrix_times_acceleration_plus_bias(robot, seed):
    """Eq. (4)."""
    state, arm = random_state(robot, seed), functions_of(robot)
    bias = arm.call(arm.inverse, state, state.q, state.qd, 0 * state.qdd).ravel()
    assert worst(arm.mass_matrix(state) @ state.qdd + bias, arm.torques(state)) < IDENTITY


@pytest.mark.parametrize(("robot", "seed"), CASES)
def test_joint_power_is_the_rate_of_energy(robot, seed):
    """qd' tau = d/dt (kinetic + potential), rotors included: the energies are Pinocchio's."""
    state, arm = random_state(robot, seed), functions_of(robot)
    tree, step = Tree(robot, state), 1e-5

    def energy(time: float) -> float:
        q = state.q + state.qd * time + state.qdd * time**2 / 2
        moved = State(state.design, state.payload, state.gear_ratio, q, state.qd + state.qdd * time, state.qdd)
        return tree.kinetic_energy(moved) + tree.potential_energy(q)

    # Fourth-order differences: with 1e-5 s what is left is rounding of the energies, 1e-16 E / 1e-5 s.
    rate = (8 * (energy(step) - energy(-step)) - (energy(2 * step) - energy(-2 * step))) / (12 * step)
    power = arm.torques(state) @ state.qd
    scale = np.abs(arm.torques(state)) @ np.abs(state.qd)
    assert abs(power - rate) < DIFFERENCES * scale


@pytest.mark.parametrize(("robot", "seed"), CASES[::3])
def test_kinetic_energy_is_that_of_the_mass_matrix(robot, seed):
    state = random_state(robot, seed)
    kinetic = state.qd @ functions_of(robot).mass_matrix(state) @ state.qd / 2
    assert kinetic == pytest.approx(Tree(robot, state).kinetic_energy(state), rel=PINOCCHIO)


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_gradients_against_central_differences(robot):
    """Of torques and accelerations in states, inputs, payload, gears and every motor dimension."""
    state, arm = random_state(robot, 1), functions_of(robot)
    flat = ca.SX.sym("x", sum(x.numel() for x in arm.x))
    parts = ca.vertsplit(flat, np.cumsum([0, *(x.numel() for x in arm.x)]).tolist())
    shaped = [ca.reshape(part, *x.shape) for part, x in zip(parts, arm.x, strict=True)]
    outputs = ca.vertcat(arm.inverse(*shaped), arm.forward(*shaped))
    values = ca.Function("values", [flat], [outputs])
    jacobian = ca.Function("jacobian", [flat], [ca.jacobian(outputs, flat)])
    point = np.concatenate([state.design.ravel(), [state.payload], state.gear_ratio, state.q, state.qd, state.qdd])
    size = np.maximum(np.abs(point), 1e-3)
    exact = jacobian(point).full() * size
    found = np.empty_like(exact)
    for k in range(len(point)):
        step = np.zeros(len(point))
        step[k] = 1e-6 * size[k]
        found[:, k] = (values(point + step) - values(point - step)).full().ravel() / 2e-6
    scale = np.abs(exact).max(axis=1, keepdims=True)
    assert (np.abs(found - exact) / scale).max() < DIFFERENCES


def test_unloaded_arm_is_lighter():
    """The payload hangs at the tool: one kilogram adds its distance squared and its own inertia to joint 1."""
    robot = random_robot(1)
    state = random_state(robot, 0)
    axis, moment = robot.screw_axes[0, :3], robot.screw_axes[0, 3:]
    arm = robot.tool_home[:3, 3] - np.cross(axis, moment)
    across = arm - axis * (axis @ arm)
    masses = [
        functions_of(robot).mass_matrix(State(state.design, kg, state.gear_ratio, state.q, state.qd, state.qdd))[0, 0]
        for kg in (0.0, 1.0)
    ]
    assert masses[1] - masses[0] == pytest.approx(across @ across + 0.4 * 0.05**2, rel=1e-9)  # rounding of the sum


def test_rotor_enters_with_the_square_of_its_gear():
    """At joint 1 the rotor stands on the base: M_11 grows by J Z^2, whatever the sign of Z."""
    robot = random_robot(1)
    state = random_state(robot, 0)

    def inertia(Z: float) -> float:
        return functions_of(robot).mass_matrix(State(state.design, 1.0, np.array([Z]), state.q, state.qd, state.qdd))[
            0, 0
        ]

    L, R_ro = state.design[0, :2]
    J = 0.5 * 7650 * np.pi * R_ro**4 * L
    assert inertia(-150.0) == pytest.approx(inertia(150.0), rel=1e-14)
    assert inertia(150.0) - inertia(50.0) == pytest.approx(J * (150**2 - 50**2), rel=1e-9)


def algorithm_1(robot: Robot, state: State, tau: np.ndarray, *, cross_terms: bool) -> np.ndarray:
    """Algorithm 1 in numbers, transposes and signs repaired; the coupling of link and rotor kept or left out."""
    n = robot.joints
    motors = [evaluate_motor(design, MotorData())[0] for design in state.design]
    arm = build_arm(robot, motors, state.payload, state.gear_ratio)
    G_L = [ca.DM(inertia).full() for inertia in arm.link_inertia]
    G_R = [ca.DM(inertia).full() for inertia in arm.rotor_inertia]
    V, X, A_L, A_R, xi, p_L, p_R = np.zeros(6), [], [], [], [], [], []
    for k in range(n):
        R, p = expm(state.q[k] * cross(arm.axes[k])), arm.offsets[k]
        X.append(np.block([[R.T, np.zeros((3, 3))], [-R.T @ cross(p), R.T]]))
        A_L.append(np.concatenate([arm.axes[k], np.zeros(3)]))
        A_R.append(state.gear_ratio[k] * np.concatenate([arm.axes[k], np.cross(arm.motor_positions[k], arm.axes[k])]))
        carrier, V_R = V, V + A_R[k] * state.qd[k]
        V = X[k] @ V + A_L[k] * state.qd[k]
        xi.append(ad(V) @ A_L[k] * state.qd[k])
        p_L.append(-ad(V).T @ G_L[k] @ V)
        p_R.append(-ad(carrier).T @ G_R[k] @ V_R)
    D = np.zeros(n)
    for k in reversed(range(n)):
        U_L, U_R, f_L = G_L[k] @ A_L[k], G_R[k] @ A_R[k], p_L[k] + G_L[k] @ xi[k]
        D[k] = 1 / (A_L[k] @ U_L + A_R[k] @ U_R)
        if k > 0:
            mu_L, mu_R = tau[k] - A_L[k] @ f_L, tau[k] - A_R[k] @ p_R[k]
            G_L[k - 1] = G_L[k - 1] + X[k].T @ (G_L[k] - D[k] * np.outer(U_L, U_L)) @ X[k]
            G_L[k - 1] = G_L[k - 1] + G_R[k] - D[k] * np.outer(U_R, U_R)
            p_L[k - 1] = p_L[k - 1] + X[k].T @ (f_L + U_L * D[k] * mu_L) + p_R[k] + U_R * D[k] * mu_R
            if cross_terms:
                coupling = np.outer(X[k].T @ U_L, U_R)
                G_L[k - 1] = G_L[k - 1] - D[k] * (coupling + coupling.T)
                p_L[k - 1] = p_L[k - 1] - D[k] * (X[k].T @ U_L * (A_R[k] @ p_R[k]) + U_R * (A_L[k] @ f_L))
    V_dot, qdd = np.concatenate([np.zeros(3), -robot.gravity]), np.zeros(n)
    for k in range(n):
        carried = X[k] @ V_dot
        link = A_L[k] @ (G_L[k] @ (carried + xi[k]) + p_L[k])
        qdd[k] = D[k] * (tau[k] - link - A_R[k] @ (G_R[k] @ V_dot + p_R[k]))
        V_dot = carried + A_L[k] * qdd[k] + xi[k]
    return qdd


def cross(w: np.ndarray) -> np.ndarray:
    return np.cross(np.eye(3), w)


def ad(V: np.ndarray) -> np.ndarray:
    return np.block([[cross(V[:3]), np.zeros((3, 3))], [cross(V[3:]), cross(V[:3])]])


def test_printed_recursion_is_wrong_by_its_missing_cross_terms():
    """Departure 7: with the terms that couple link and rotor it is exact, without them it is off by percents."""
    robot, off = Robot.preset(REFERENCE["robot"]), []
    for sample in REFERENCE["samples"]:
        state, tau = reference_state(sample), np.array(sample["joint_torque_Nm"])
        assert worst(algorithm_1(robot, state, tau, cross_terms=True), state.qdd) < PINOCCHIO
        off.append(worst(algorithm_1(robot, state, tau, cross_terms=False), state.qdd))
    assert min(off) == pytest.approx(0.0024, abs=5e-5)  # as docs/model.md says, to its digits
    assert max(off) == pytest.approx(0.046, abs=5e-4)
