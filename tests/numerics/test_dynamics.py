"""Forward dynamics, inverse dynamics and mass matrix: against Pinocchio, against each other, against energy."""

from __future__ import annotations

import json
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

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


@pytest.mark.parametrize("sample", REFERENCE["samples"])
def test_inverse_dynamics_equals_the_reference(sample):
    robot = Robot.preset(REFERENCE["robot"])
    state = State(
        design=np.array(sample["design_mm"]) * 1e-3,
        payload=sample["payload_kg"],
        gear_ratio=robot.gear_ratio,
        q=np.array(sample["q_rad"]),
        qd=np.array(sample["qd_rad_s"]),
        qdd=np.array(sample["qdd_rad_s2"]),
    )
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
