"""Replay, voltage laws and certificates: closed books, equations by hand, and errors that must be seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from services.codesign.certify import BALANCE_TOLERANCE, certify
from services.codesign.motion import Motion, motors_of_design
from services.codesign.plant import cross_implicitly
from services.codesign.problem import Accuracy, Problem, Task, Transcription
from services.codesign.replay import ReplayError, replay
from services.codesign.robot import Robot
from services.codesign.runge_kutta import Stepper
from services.codesign.solve import Solution, SolverOptions, solve
from services.codesign.voltage_law import VoltageLaw, path_of, voltage_law
from tests.numerics.arms import random_designs, random_robot
from tests.numerics.tasks import paper_problem
from tests.numerics.test_collocation import DESIGN, STARTS, U_D, U_Q, pendulum, pendulum_end

INTEGRATED = 1e-7
"""Relative to the largest: two integrators with tolerances of 1e-9 and 1e-13, over some hundred steps."""

CURRENT = Transcription("radau", 2, 50, "current")


def started(state: np.ndarray) -> Motion:
    """A motion of which only the start matters; `state` is (q, qd, i_d, i_q), each (n,)."""
    q, qd, i_d, i_q = (part[None] for part in np.split(state, 4))
    nothing = np.zeros(1)
    return Motion(nothing, nothing, q, qd, i_d, i_q, 0 * q, 0 * q, 0 * q)


def constant_law(final_time: float, intervals: int, u_d: np.ndarray, u_q: np.ndarray) -> VoltageLaw:
    """The same voltages all the time."""
    held = [np.tile(u, (intervals, 1, 1)) for u in (u_d, u_q)]
    return VoltageLaw(np.linspace(0, final_time, intervals + 1), *held)


def problem_of(robot: Robot, payload: float = 0.0) -> Problem:
    rest = np.zeros(robot.joints)
    return Problem(robot, Task(rest, rest, payload))


@pytest.mark.parametrize("start", STARTS, ids=range(len(STARTS)))
def test_replay_of_a_pendulum_is_that_of_the_equations_by_hand(start):
    law = constant_law(0.05, 3, np.array([U_D]), np.array([U_Q]))
    found = replay(problem_of(pendulum()), DESIGN[None], started(start), law)
    end = np.concatenate([x[-1, -1] for x in (found.position, found.speed, found.current_d, found.current_q)])
    exact = pendulum_end(start, 0.05, current_control=False)
    assert end == pytest.approx(exact, rel=INTEGRATED, abs=INTEGRATED * np.abs(exact).max())
    assert found.time[-1, -1] == pytest.approx(0.05)


@pytest.mark.parametrize("seed", range(2))
def test_both_energy_balances_close_on_an_arm_without_symmetry(seed):
    """Algorithm 1 and eq. (1) against kinetic, potential and field energy: each side knows nothing of the other."""
    rng, robot = np.random.default_rng(seed), random_robot(3, seed)
    law = VoltageLaw(np.array([0, 0.01, 0.03]), *rng.uniform(-20, 20, (2, 2, 4, 3)))
    state = np.concatenate([rng.uniform(-1, 1, 3), rng.uniform(-0.5, 0.5, 3), rng.uniform(-2, 2, 6)])
    e = replay(problem_of(robot, 1.3), random_designs(3, rng), started(state), law).energies
    turned_over = abs(e.electrical) + e.copper + abs(e.shaft)
    assert e.electrical - e.copper - e.field_change - e.shaft == pytest.approx(0, abs=BALANCE_TOLERANCE * turned_over)
    assert e.shaft == pytest.approx(e.mechanical_change, abs=BALANCE_TOLERANCE * turned_over)
    assert e.copper > 0
    assert np.abs(e.mechanical_change) > 1e-3 * turned_over, "nothing moved: the test says nothing"


EXPLICIT = 1e-6
"""Absolute (rad, rad/s, A): what CVODES at 1e-9 adds up over some 3000 steps; the explicit one is closer by far."""


def test_explicit_steps_follow_the_implicit_integrator(solution, monkeypatch):
    """Two methods that have nothing in common, on solved motions."""
    law = voltage_law(solution.problem, solution.design, solution.motion)
    explicit = replay(solution.problem, solution.design, solution.motion, law)
    monkeypatch.setattr(Stepper, "cross", lambda *_: None)
    implicit = replay(solution.problem, solution.design, solution.motion, law)
    for name in ("position", "speed", "current_d", "current_q"):
        assert getattr(explicit, name) == pytest.approx(getattr(implicit, name), abs=20 * EXPLICIT), name
    assert explicit.position == pytest.approx(implicit.position, abs=EXPLICIT)
    small = 1e-6 * (implicit.energies.copper + abs(implicit.energies.electrical))
    for name in ("electrical", "copper", "shaft", "effort", "recovered", "mechanical_change"):
        found, known = getattr(explicit.energies, name), getattr(implicit.energies, name)
        assert found == pytest.approx(known, rel=1e-6, abs=small), name


def test_a_stiff_interval_is_crossed_implicitly(monkeypatch):
    """Intervals of three seconds, a thousand time constants of the winding: too many explicit steps."""
    crossed = []

    def seen(*arguments):
        crossed.append(True)
        return cross_implicitly(*arguments)

    monkeypatch.setattr("services.codesign.replay.cross_implicitly", seen)
    law = constant_law(6.0, 2, np.array([U_D]), np.array([U_Q]))
    found = replay(problem_of(pendulum()), DESIGN[None], started(STARTS[0]), law)
    assert crossed, "explicit steps were enough: the test says nothing"
    end = np.concatenate([x[-1, -1] for x in (found.position, found.speed, found.current_d, found.current_q)])
    exact = pendulum_end(STARTS[0], 6.0, current_control=False)
    assert end == pytest.approx(exact, rel=10 * INTEGRATED, abs=10 * INTEGRATED * np.abs(exact).max())


def test_a_replay_does_not_depend_on_the_one_before(solution):
    law = voltage_law(solution.problem, solution.design, solution.motion)
    first, second = (replay(solution.problem, solution.design, solution.motion, law) for _ in range(2))
    assert (first.position == second.position).all()
    assert first.energies.electrical == second.energies.electrical


def test_a_motion_that_leaves_all_bounds_is_said_to():
    law = constant_law(1.0, 1, np.array([np.nan]), np.array([0.0]))
    with pytest.raises(ReplayError, match="interval 1 of 1"):
        replay(problem_of(pendulum()), DESIGN[None], started(STARTS[0]), law)


@pytest.fixture(scope="module", params=["paper", "current", "unequal", "legendre"])
def solution(request) -> Solution:
    widths = tuple(np.repeat([1 / 60, 1 / 30], 20).tolist())
    transcriptions = {
        "paper": Transcription(),
        "current": CURRENT,
        "unequal": Transcription("radau", 2, 40, "current", widths=widths),
        "legendre": Transcription("legendre", 1, 50, "current"),
    }
    return solve(paper_problem(0.4, 1.0, "energy", transcription=transcriptions[request.param]))


def test_the_law_gives_the_motions_voltages_at_its_points(solution):
    problem, motion = solution.problem, solution.motion
    law = voltage_law(problem, solution.design, motion)
    points = problem.layout.collocation.points
    stops = problem.layout.stops
    inside = np.concatenate([points, [1.0]])[:stops]
    for known, found in zip((motion.voltage_d, motion.voltage_q), law.at(inside), strict=True):
        # Where the end is no point, the motion's voltage there is that of the end state: the same polynomial's.
        assert found.reshape(-1, 6) == pytest.approx(known[1:], abs=1e-6 * 100)
    assert law.breaks[-1] == motion.final_time


def test_the_path_runs_through_the_points(solution):
    path = path_of(solution.problem, solution.motion)
    position, speed = path.at(solution.problem.layout.collocation.points)
    stops, degree = solution.problem.layout.stops, solution.problem.layout.degree
    known = solution.motion.position[1:].reshape(-1, stops, 6)[:, :degree]
    assert position == pytest.approx(known, abs=1e-12)
    assert speed == pytest.approx(solution.motion.speed[1:].reshape(-1, stops, 6)[:, :degree], abs=1e-12)


def test_certificate_of_current_control_and_of_the_paper(solution):
    certificate = certify(solution)
    control = solution.problem.transcription.control
    assert certificate.electrical_balance.closed
    assert certificate.mechanical_balance.closed
    assert certificate.kkt_residual == solution.kkt_residual
    assert max(check.at_points for check in certificate.limits.values()) < 1e-6
    if control == "voltage":
        assert certificate.replay_speed > 0.05
        assert certificate.limits["current"].between_points > 0.1
        assert not certificate.meets(Accuracy())
    elif solution.problem.transcription.degree > 1:
        assert certificate.replay_position < 1e-4
        assert certificate.path_position < 1e-3
        assert certificate.limits["rotor_speed"].between_points < 1e-3
    # One point an interval does not see that the voltage rises and falls within it: the replay does.
    booked = 0.1 if control == "current" and solution.problem.transcription.degree == 1 else 1e-2
    assert certificate.energies.effort == pytest.approx(solution.measures.effort, rel=booked)


def test_load_is_that_of_the_motion_between_its_points(solution):
    """Peaks against the limits' own check; squares of currents against the copper loss, integrated otherwise."""
    problem, certificate = solution.problem, certify(solution)
    load, resistance = certificate.load, motors_of_design(solution.design, problem).phase_resistance
    currents = max(load.peaks["current_d"].max(), load.peaks["current_q"].max())
    assert max(currents - 1, 0) == pytest.approx(certificate.limits["current"].between_points, abs=1e-12)
    speed_excess = certificate.limits["rotor_speed"].between_points
    assert max(load.peaks["rotor_speed"].max() - 1, 0) == pytest.approx(speed_excess, abs=1e-12)
    squares = (load.rms["current_d"] ** 2 + load.rms["current_q"] ** 2) * problem.motor.current_limit**2
    copper = 1.5 * resistance @ squares * solution.motion.final_time
    assert copper == pytest.approx(certificate.energies.copper, rel=1e-3)
    assert load.peaks["joint_torque"] == pytest.approx(load.peaks["current_q"])
    for name, peaks in solution.measures.load.peaks.items():
        # The grid's are states of the motion, the load's of its replay.
        if problem.transcription.degree > 1:
            assert (load.peaks[name] > peaks - 1e-3).all(), name


def test_certificate_sees_a_voltage_that_is_wrong():
    """One percent on one motor in one interval: not of the transcription's making, and found all the same."""
    solution = solved_with_currents()
    good = certify(solution)
    voltage = solution.motion.current_q.copy()
    voltage[40:60, 1] *= 1.01
    bad = certify(replace(solution, motion=replace(solution.motion, current_q=voltage)))
    assert good.meets(Accuracy(limit=0.01))
    assert not bad.meets(Accuracy(limit=0.01))
    assert bad.replay_position > 30 * good.replay_position
    afterwards = bad.growth.position[40:].max()
    assert afterwards < 0.1 * bad.growth.position.max(), "the error is looked for where it does not sit"


def test_a_failed_solve_has_no_certificate():
    with pytest.raises(ValueError, match="failed solve"):
        certify(solve(paper_problem(1.0, 4.0, "energy", transcription=Transcription(intervals=8)), options=ONE_STEP))


ONE_STEP = SolverOptions(max_iter=1)


def solved_with_currents() -> Solution:
    return solve(paper_problem(0.4, 1.0, "energy", transcription=CURRENT))
