"""Arms and motors to test with, and the same arms as Pinocchio trees: one body a link, one a rotor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
import pinocchio as pin

from services.codesign.arm import build_arm
from services.codesign.forward_dynamics import forward_dynamics
from services.codesign.inverse_dynamics import inverse_dynamics
from services.codesign.mass_matrix import mass_matrix
from services.codesign.motor import evaluate_motor, motor_parameters
from services.codesign.motor_data import MotorData
from services.codesign.robot import Robot

PAYLOAD_BALL_RADIUS = 0.05  # m, MODEL section 3


def rotation_matrix(rng: np.random.Generator) -> np.ndarray:
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return Q * np.sign(np.linalg.det(Q))


def pose(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    return np.block([[R, p[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])


def random_robot(joints: int, seed: int = 0) -> Robot:
    """Axes, masses, motor positions and gears without any symmetry; some gears reverse."""
    rng = np.random.default_rng([joints, seed])
    axes = rng.normal(size=(joints, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    through = rng.uniform(-0.5, 0.5, (joints, 3))
    factors = rng.normal(size=(joints, 3, 3)) * 0.1
    return Robot(
        name=f"random-{joints}-{seed}",
        gravity=rng.normal(size=3) * 5,
        screw_axes=np.hstack([axes, np.cross(through, axes)]),
        link_com_home=np.array([pose(rotation_matrix(rng), rng.uniform(-0.5, 0.5, 3)) for _ in range(joints)]),
        link_mass=rng.uniform(0.5, 8, joints),
        link_inertia=factors @ factors.transpose(0, 2, 1) + 1e-3 * np.eye(3),
        motor_position=rng.uniform(-0.5, 0.5, (joints, 3)),
        tool_home=pose(rotation_matrix(rng), rng.uniform(-0.5, 0.5, 3)),
        gear_ratio=rng.uniform(20, 160, joints) * rng.choice([-1, 1], joints),
        joint_lower=np.full(joints, -3.0),
        joint_upper=np.full(joints, 3.0),
        rotor_speed_limit=100 * np.pi,
    )


def random_designs(joints: int, rng: np.random.Generator) -> np.ndarray:
    """Buildable motors, shape (n, 7) m: slots are open and hold copper; the other limits are not looked at."""
    L, R_ro, slot, h_m, h_sy, w_tooth, b_0 = rng.uniform(
        [20, 14, 3, 1, 5, 5, 1], [100, 30, 20, 5, 10, 7, 3], (joints, 7)
    ).T
    R_so = R_ro + 0.5 + 2 + slot + h_sy
    return np.column_stack([L, R_ro, R_so, h_m, h_sy, w_tooth, b_0]) * 1e-3


@dataclass(frozen=True)
class State:
    """One state of an arm with its motors."""

    design: np.ndarray  # (n, 7) m
    payload: float  # kg
    gear_ratio: np.ndarray  # (n,)
    q: np.ndarray  # rad
    qd: np.ndarray  # rad/s
    qdd: np.ndarray  # rad/s2


def random_state(robot: Robot, seed: int) -> State:
    rng = np.random.default_rng([robot.joints, seed, 7])
    n = robot.joints
    return State(
        design=random_designs(n, rng),
        payload=rng.uniform(0, 5),
        gear_ratio=robot.gear_ratio * rng.uniform(0.5, 1.5, n),
        q=rng.uniform(-3, 3, n),
        qd=rng.uniform(-3, 3, n),
        qdd=rng.uniform(-20, 20, n),
    )


class ArmFunctions:
    """The symbolic dynamics as functions of (design (7, n), payload, gear ratios, q, qd, then qdd or tau)."""

    def __init__(self, robot: Robot) -> None:
        n = robot.joints
        design, payload, gear = ca.SX.sym("design", 7, n), ca.SX.sym("payload"), ca.SX.sym("gear", n)
        q, qd, last = (ca.SX.sym(name, n) for name in ("q", "qd", "last"))
        coefficients = MotorData().coefficients()
        motors = [motor_parameters(design[:, k], coefficients) for k in range(n)]
        arm = build_arm(robot, motors, payload, gear)
        setting = [design, payload, gear]
        tau, qdd, M = inverse_dynamics(arm, q, qd, last), forward_dynamics(arm, q, qd, last), mass_matrix(arm, q)
        self.x = [*setting, q, qd, last]
        self.tau, self.qdd, self.M = tau, qdd, M
        self.inverse = ca.Function("inverse", self.x, [tau])
        self.forward = ca.Function("forward", self.x, [qdd])
        self.mass = ca.Function("mass", [*setting, q], [M])

    def call(self, function: Callable[..., ca.DM], state: State, *more: np.ndarray) -> np.ndarray:
        values = function(state.design.T, state.payload, state.gear_ratio, *more).full()
        return values.ravel() if values.shape[1] == 1 and values.shape[0] == len(state.q) else values

    def torques(self, state: State) -> np.ndarray:
        return self.call(self.inverse, state, state.q, state.qd, state.qdd).ravel()

    def accelerations(self, state: State, tau: np.ndarray) -> np.ndarray:
        return self.call(self.forward, state, state.q, state.qd, tau).ravel()

    def mass_matrix(self, state: State) -> np.ndarray:
        n = len(state.q)
        return self.call(self.mass, state, state.q).reshape(n, n)


_FUNCTIONS: dict[str, ArmFunctions] = {}


def functions_of(robot: Robot) -> ArmFunctions:
    if robot.name not in _FUNCTIONS:
        _FUNCTIONS[robot.name] = ArmFunctions(robot)
    return _FUNCTIONS[robot.name]


@lru_cache(maxsize=1)
def default_motor() -> MotorData:
    return MotorData()


def solid_of_revolution(axial: float, transverse: float, axis: np.ndarray) -> np.ndarray:
    return transverse * np.eye(3) + (axial - transverse) * np.outer(axis, axis)


class Tree:
    """The arm as Pinocchio sees it: 2n revolute joints; joint n + k is rotor k, on link k - 1 beside joint k.

    Written from the description of the bodies (MODEL section 3), without the production code's bookkeeping.
    """

    def __init__(self, robot: Robot, state: State) -> None:
        self.n = n = robot.joints
        self.gear = state.gear_ratio
        motors = [evaluate_motor(design, default_motor())[0] for design in state.design]
        axes = robot.screw_axes[:, :3]
        origins = np.cross(axes, robot.screw_axes[:, 3:])
        self.model = model = pin.Model()
        model.gravity.linear = robot.gravity
        links, parent = [0], np.zeros(3)
        rotors = []
        for k in range(n):
            at = pin.SE3(np.eye(3), robot.motor_position[k] - parent)
            rotors.append(
                model.addJoint(links[-1], pin.JointModelRevoluteUnaligned(axes[k]), at, f"rotor{k}"),
            )
            inertia = solid_of_revolution(motors[k].rotor_inertia_axial, motors[k].rotor_inertia_transverse, axes[k])
            model.appendBodyToJoint(
                rotors[-1], pin.Inertia(motors[k].rotor_mass, np.zeros(3), inertia), pin.SE3.Identity()
            )
            if k > 0:
                ring = solid_of_revolution(motors[k].stator_inertia_axial, motors[k].stator_inertia_transverse, axes[k])
                model.appendBodyToJoint(links[-1], pin.Inertia(motors[k].stator_mass, np.zeros(3), ring), at)
            joint = pin.JointModelRevoluteUnaligned(axes[k])
            links.append(model.addJoint(links[-1], joint, pin.SE3(np.eye(3), origins[k] - parent), f"link{k}"))
            home = robot.link_com_home[k]
            centre = pin.SE3(home[:3, :3], home[:3, 3] - origins[k])
            body = pin.Inertia(robot.link_mass[k], np.zeros(3), robot.link_inertia[k])
            model.appendBodyToJoint(links[-1], body, centre)
            parent = origins[k]
        ball = pin.Inertia(state.payload, np.zeros(3), 0.4 * state.payload * PAYLOAD_BALL_RADIUS**2 * np.eye(3))
        model.appendBodyToJoint(links[-1], ball, pin.SE3(np.eye(3), robot.tool_home[:3, 3] - parent))
        self.data = model.createData()
        self.link_index = [model.joints[j].idx_v for j in links[1:]]
        self.rotor_index = [model.joints[j].idx_v for j in rotors]

    @property
    def spread(self) -> np.ndarray:
        """S: joint rates -> rates of all 2n bodies' joints."""
        S = np.zeros((2 * self.n, self.n))
        S[self.link_index, range(self.n)] = 1
        S[self.rotor_index, range(self.n)] = self.gear
        return S

    def torques(self, state: State) -> np.ndarray:
        S = self.spread
        return S.T @ pin.rnea(self.model, self.data, S @ state.q, S @ state.qd, S @ state.qdd)

    def mass_matrix(self, state: State) -> np.ndarray:
        S = self.spread
        upper = np.triu(pin.crba(self.model, self.data, S @ state.q))
        return S.T @ (upper + np.triu(upper, 1).T) @ S

    def kinetic_energy(self, state: State) -> float:
        S = self.spread
        return pin.computeKineticEnergy(self.model, self.data, S @ state.q, S @ state.qd)

    def potential_energy(self, q: np.ndarray) -> float:
        return pin.computePotentialEnergy(self.model, self.data, self.spread @ q)
