"""Friction at the joints: the torques by hand, the energy that they take, and a motion that needs longer for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from services.codesign.accuracy import solve_accurately
from services.codesign.certify import BALANCE_TOLERANCE, certify
from services.codesign.friction import TURNING_SPEED
from services.codesign.problem import Accuracy, Problem, Task
from services.codesign.replay import replay
from services.codesign.robot import Robot
from services.codesign.solver import SolverOptions
from services.codesign.voltage_law import VoltageLaw
from tests.numerics.arms import functions_of, random_designs, random_robot, random_state
from tests.numerics.test_collocation import pendulum
from tests.numerics.test_replay import problem_of, started


def rubbing(robot: Robot, seed: int = 0) -> Robot:
    """The robot with friction; its last joint has none."""
    rng = np.random.default_rng([seed, 13])
    viscous, coulomb = rng.uniform(0.1, 5, (2, robot.joints))
    if robot.joints > 1:
        viscous[-1] = coulomb[-1] = 0.0
    return replace(robot, name=f"{robot.name}-rubbing", viscous_friction=viscous, coulomb_friction=coulomb)


@pytest.mark.parametrize("joints", [1, 3, 7])
def test_torques_are_those_by_hand_and_forward_undoes_inverse(joints):
    smooth, rough = random_robot(joints), rubbing(random_robot(joints))
    for seed in range(5):
        state = random_state(smooth, seed)
        taken = rough.viscous_friction * state.qd + rough.coulomb_friction * np.tanh(state.qd / TURNING_SPEED)
        tau = functions_of(rough).torques(state)
        assert tau - functions_of(smooth).torques(state) == pytest.approx(taken, rel=1e-9, abs=1e-9)
        assert functions_of(rough).accelerations(state, tau) == pytest.approx(state.qdd, rel=1e-9, abs=1e-9)


def test_energy_lost_is_that_of_the_friction_torque():
    """Booked by the integrator, against the trapezoidal rule over its samples; the balance closes with it."""
    rng, robot = np.random.default_rng(1), rubbing(random_robot(3, 1))
    law = VoltageLaw(np.linspace(0, 0.03, 21), *rng.uniform(-20, 20, (2, 20, 2, 3)))
    state = np.concatenate([rng.uniform(-1, 1, 3), rng.uniform(-0.5, 0.5, 3), rng.uniform(-2, 2, 6)])
    found = replay(problem_of(robot, 1.3), random_designs(3, rng), started(state), law)
    e, qd = found.energies, found.speed
    power = (robot.viscous_friction * qd + robot.coulomb_friction * np.tanh(qd / TURNING_SPEED)) * qd
    summed = np.trapezoid(power.sum(axis=2), found.time, axis=1).sum()
    assert e.friction == pytest.approx(summed, rel=1e-3)  # the rule's own error on 20 samples an interval
    turned_over = abs(e.shaft) + e.friction + abs(e.mechanical_change)
    assert e.shaft - e.mechanical_change - e.friction == pytest.approx(0, abs=BALANCE_TOLERANCE * turned_over)
    assert e.friction > 1e-3 * turned_over, "nothing rubbed: the test says nothing"


def test_motion_of_a_pendulum_with_friction():
    """A minimum-time motion takes longer with friction, and its replay arrives all the same."""
    smooth = pendulum()
    rough = replace(smooth, name="rough", viscous_friction=np.array([4.0]), coulomb_friction=np.array([4.0]))
    task = Task(np.array([0.8]), np.array([0.0]), 1.0)
    times = []
    for robot in (smooth, rough):
        found = solve_accurately(Problem(robot, task), Accuracy(), SolverOptions())
        assert found.solution.success
        certificate = certify(found.solution)
        assert certificate.meets(Accuracy())
        assert certificate.mechanical_balance.closed
        times.append(found.solution.measures.final_time)
    assert times[1] > times[0] * 1.02
    assert certificate.energies.friction > 0.1
