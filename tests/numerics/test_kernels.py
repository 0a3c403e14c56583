"""Compiled kernels against the CasADi virtual machine and against differences; the cache that keeps them."""

from __future__ import annotations

import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from services.codesign import kernels as kernels_module
from services.codesign import plant as plant_module
from services.codesign.interval import CONTROLS, IntervalLayout
from services.codesign.kept import Kept
from services.codesign.kernels import OVER_LANES, SHARED_INPUTS, Kernels, cache_key, load_kernels
from services.codesign.lanes import LANES, lanes_source
from services.codesign.motor_data import CONSTRAINTS, MotorData
from services.codesign.plant import plant_key
from services.codesign.robot import Robot
from tests.numerics.arms import random_robot

ROUNDING = 1e-10
"""Relative to the largest entry: the compiler may contract and reorder a sum that the virtual machine does not."""
DIFFERENCES = 1e-5
"""Relative to the largest entry of a row: central differences with steps of 1e-6 of terms up to 1e3 times larger."""

LAYOUTS = [
    IntervalLayout(2, scheme, degree, control)
    for scheme, degree in (("radau", 1), ("radau", 2), ("legendre", 2))
    for control in CONTROLS
]
DESIGN = np.array([60, 14, 36, 3, 5.5, 6, 2]) * 1e-3


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("kernels")


@pytest.fixture
def no_compiler(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)


def interval_inputs(layout: IntervalLayout, seed: int = 0) -> list[np.ndarray]:
    """(start, variables, design, final_time, width, parameters), all of order one."""
    rng = np.random.default_rng(seed)
    n = layout.joints
    parameters = np.concatenate(
        [
            MotorData().coefficients(),
            DESIGN,
            rng.uniform(50, 120, n),  # gear ratios
            [1.5],  # payload
            np.full(n, 3.0),  # scales: speed, current, voltage, torque
            [3.0],
            [100.0],
            np.full(n, 150.0),
            [0.7, 0.4],  # weights of u'u and of electrical power
        ]
    )
    return [
        rng.uniform(-1, 1, layout.state_size),
        rng.uniform(-1, 1, layout.variables),
        rng.uniform(0.95, 1.05, 7 * n),
        np.array([0.8]),
        np.array([0.1]),
        parameters,
    ]


def motor_inputs(layout: IntervalLayout) -> list[np.ndarray]:
    _, _, design, _, _, parameters = interval_inputs(layout)
    return [design[:7], parameters]


def all_inputs(layout: IntervalLayout, seed: int = 0) -> dict[str, list[np.ndarray]]:
    """Inputs of every kernel by name."""
    interval, motor = interval_inputs(layout, seed), motor_inputs(layout)
    rng = np.random.default_rng(5 + seed)
    lam = rng.normal(size=layout.equalities + layout.inequalities)
    n = layout.joints
    return {
        "value": interval,
        "jacobian": interval,
        "effort_gradient": interval,
        "hessian": [*interval, lam, np.array([0.3])],
        "demand": [*rng.normal(size=(3, n)), interval[2], interval[5]],
        "motor_value": motor,
        "motor_jacobian": motor,
        "motor_hessian": [*motor, rng.normal(size=len(CONSTRAINTS))],
    }


def in_lanes(layout: IntervalLayout, name: str) -> list[np.ndarray]:
    """Inputs of a kernel, a different point in each lane."""
    points = zip(*(all_inputs(layout, seed)[name] for seed in range(LANES)), strict=True)
    return [parts[0] if i in SHARED_INPUTS else np.column_stack(parts) for i, parts in enumerate(points)]


@pytest.mark.parametrize(
    "layout",
    [
        IntervalLayout(1, "radau", 1),
        IntervalLayout(1, "legendre", 1, "current", "forward"),
        IntervalLayout(2, "radau", 2, "current"),
    ],
    ids=str,
)
def test_compiled_kernels_equal_the_virtual_machine(layout, cache, request, tmp_path):
    robot = random_robot(layout.joints)
    compiled = load_kernels(robot, layout, cache)
    request.getfixturevalue("no_compiler")
    virtual = load_kernels(robot, layout, tmp_path / "nothing here")
    assert (compiled.compiled, compiled.lanes) == (True, LANES)
    assert (virtual.compiled, virtual.lanes) == (False, 1)
    assert not (tmp_path / "nothing here").exists()
    for name in all_inputs(layout):
        inputs, one, several = all_inputs(layout)[name], getattr(virtual, name), getattr(compiled, name)
        if name in OVER_LANES:
            inputs = in_lanes(layout, name)
            one = one.map(name, "serial", LANES, list(SHARED_INPUTS), [])
            assert compiled.pattern(name) == virtual.pattern(name)
        for a, b in zip(several.call(inputs), one.call(inputs), strict=True):
            assert a.sparsity() == b.sparsity()
            assert np.abs((a - b).full()).max() <= ROUNDING * np.abs(b.full()).max()


def test_an_operation_that_lanes_do_not_know_is_refused():
    x = ca.SX.sym("x")
    with pytest.raises(NotImplementedError, match="odd has operation"):
        lanes_source(ca.Function("odd", [x], [ca.erf(x)]), [])


def test_a_compiler_that_does_not_exist_is_passed_over(monkeypatch, no_compiler, tmp_path):
    monkeypatch.setenv("CC", "/nowhere/cc")
    assert not load_kernels(random_robot(1), IntervalLayout(1, "radau", 1), tmp_path).compiled


def test_a_compiler_that_fails_says_what_it_said(monkeypatch, tmp_path):
    compiler = tmp_path / "broken"
    compiler.write_text("#!/bin/sh\necho no such target >&2\nexit 3\n")
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    cache = tmp_path / "cache"
    with pytest.raises(RuntimeError, match="no such target"):
        load_kernels(random_robot(1), IntervalLayout(1, "radau", 1), cache)
    assert not any(path.suffix == ".so" or path.is_dir() for path in cache.iterdir())


def virtual_kernels(layout: IntervalLayout) -> Kernels:
    return kernels_module._virtual_machine(random_robot(layout.joints), layout)


@pytest.mark.parametrize("layout", LAYOUTS, ids=str)
def test_interval_derivatives_against_differences(layout):
    k = virtual_kernels(layout)
    start, variables, design, final_time, width, parameters = interval_inputs(layout)
    point = np.concatenate([start, variables, design, final_time])
    cuts = np.cumsum([len(start), len(variables), len(design)])
    rng = np.random.default_rng(1)
    lam, lam_effort = rng.normal(size=layout.equalities + layout.inequalities), 0.02

    def split(v: np.ndarray) -> list[np.ndarray]:
        return [*np.split(v, cuts), width, parameters]

    def values(v: np.ndarray) -> np.ndarray:
        constraints, effort = k.value(*split(v))
        return np.append(constraints.full().ravel(), float(effort))

    def gradient(v: np.ndarray) -> np.ndarray:
        jacobian, effort = k.jacobian(*split(v)), k.effort_gradient(*split(v))
        return jacobian.full().T @ lam + lam_effort * effort.full().ravel()

    exact = np.vstack([k.jacobian(*split(point)).full(), k.effort_gradient(*split(point)).full().T])
    assert row_error(exact, differences(values, point)) < DIFFERENCES
    upper = k.hessian(*split(point), lam, lam_effort).full()
    hessian = upper + np.triu(upper, 1).T
    assert np.array_equal(upper, np.triu(upper))
    found = differences(gradient, point)
    assert np.abs(hessian - found).max() < DIFFERENCES * np.abs(hessian).max()


def test_motor_derivatives_against_differences():
    layout = LAYOUTS[0]
    k = virtual_kernels(layout)
    design, parameters = motor_inputs(layout)
    lam = np.random.default_rng(2).normal(size=len(CONSTRAINTS))
    jacobian = k.motor_jacobian(design, parameters).full()
    found = differences(lambda v: k.motor_value(v, parameters).full().ravel(), design)
    assert row_error(jacobian, found) < DIFFERENCES
    upper = k.motor_hessian(design, parameters, lam).full()
    hessian = upper + np.triu(upper, 1).T
    found = differences(lambda v: k.motor_jacobian(v, parameters).full().T @ lam, design)
    assert np.abs(hessian - found).max() < DIFFERENCES * np.abs(hessian).max()


def differences(function, point: np.ndarray) -> np.ndarray:
    columns = []
    for k in range(len(point)):
        step = np.zeros(len(point))
        step[k] = 1e-6
        columns.append((function(point + step) - function(point - step)) / 2e-6)
    return np.column_stack(columns)


def row_error(exact: np.ndarray, found: np.ndarray) -> float:
    return float((np.abs(exact - found) / np.abs(exact).max(axis=1, keepdims=True)).max())


BUILD = """
import sys
from pathlib import Path
from services.codesign.interval import IntervalLayout
from services.codesign.kernels import load_kernels
from tests.numerics.arms import random_robot
from tests.numerics.test_kernels import interval_inputs
layout = IntervalLayout(1, "radau", 2)
kernels = load_kernels(random_robot(1), layout, Path(sys.argv[1]))
assert kernels.compiled
print(repr(kernels.value.call([part[:, None] for part in interval_inputs(layout)])[0].full().sum()))
"""


def test_processes_that_compile_at_once_share_one_library(tmp_path, monkeypatch):
    compiler, record, cache = tmp_path / "cc", tmp_path / "calls", tmp_path / "cache"
    compiler.write_text(f'#!/bin/sh\necho "$@" >> {record}\nexec {shutil.which("cc")} "$@"\n')
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    root = Path(__file__).parents[2]
    command = [sys.executable, "-c", BUILD, str(cache)]
    running = [
        subprocess.Popen(command, cwd=root, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) for _ in range(3)
    ]
    ended = [(process.communicate(timeout=120), process.returncode) for process in running]
    assert [code for _, code in ended] == [0, 0, 0], ended
    assert len({out for (out, _), _ in ended}) == 1
    assert len(list(cache.glob("*.so"))) == 1
    assert not any(path.is_dir() for path in cache.iterdir())  # nothing half built is left
    assert sum("-shared" in call for call in record.read_text().splitlines()) == 1  # one built, two waited


def test_a_library_in_the_cache_is_used_without_a_compiler(cache, monkeypatch):
    layout = IntervalLayout(1, "radau", 1)
    load_kernels(random_robot(1), layout, cache)
    monkeypatch.setattr(kernels_module, "_LOADED", Kept(1))
    monkeypatch.setattr(kernels_module, "_compiler", lambda: None)
    assert load_kernels(random_robot(1), layout, cache).compiled


ROBOT = Robot.preset("ur5")
LAYOUT = IntervalLayout(6, "radau", 1)


@pytest.mark.parametrize(
    ("robot", "layout"),
    [
        (replace(ROBOT, link_mass=ROBOT.link_mass * 1.01), LAYOUT),
        (replace(ROBOT, gravity=ROBOT.gravity * 0.5), LAYOUT),
        (replace(ROBOT, motor_position=ROBOT.motor_position + 0.01), LAYOUT),
        (replace(ROBOT, link_inertia=ROBOT.link_inertia * 2), LAYOUT),
        (replace(ROBOT, tool_home=np.eye(4)), LAYOUT),
        (Robot.preset("ur5_modern_robotics"), LAYOUT),
        (ROBOT, replace(LAYOUT, degree=2)),
        (ROBOT, replace(LAYOUT, scheme="legendre")),
        (ROBOT, replace(LAYOUT, control="current")),
        (ROBOT, replace(LAYOUT, dynamics="forward")),
    ],
    ids=["mass", "gravity", "motor", "inertia", "tool", "preset", "degree", "scheme", "control", "dynamics"],
)
def test_key_changes_with_what_shapes_the_code(robot, layout):
    assert cache_key(robot, layout) != cache_key(ROBOT, LAYOUT)


def test_key_changes_with_flags_and_sources(monkeypatch, tmp_path):
    before = cache_key(ROBOT, LAYOUT)
    monkeypatch.setattr(kernels_module, "COMPILER_FLAGS", ("-O2",))
    assert cache_key(ROBOT, LAYOUT) != before
    monkeypatch.undo()
    monkeypatch.setitem(kernels_module._SOURCES, "motor_data", "")
    assert cache_key(ROBOT, LAYOUT) != before


def test_the_plants_key_changes_with_flags_and_sources(monkeypatch):
    before = plant_key(ROBOT)
    monkeypatch.setattr(plant_module, "FLAGS", ("-O1",))
    assert plant_key(ROBOT) != before
    monkeypatch.undo()
    monkeypatch.setitem(kernels_module._SOURCES, "motor_data", "")
    assert plant_key(ROBOT) != before


@pytest.mark.parametrize("module", ["kernels", "plant"])
def test_key_holds_every_module_that_a_library_is_made_of(module):
    """A change of the model must never meet an old library: Python itself says what is imported."""
    script = f"import sys, services.codesign.{module}; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    beside = {name.rsplit(".", 1)[1] for name in loaded if name.startswith("services.codesign.")}
    assert set(kernels_module.made_of(module)) == beside
    assert len(beside) > 10


@pytest.mark.parametrize(
    "change",
    [
        {"gear_ratio": ROBOT.gear_ratio * 0.5},
        {"joint_lower": ROBOT.joint_lower * 0.5},
        {"rotor_speed_limit": 100.0},
        {"name": "another"},
    ],
    ids=["gear", "range", "speed", "name"],
)
def test_key_does_not_change_with_what_is_a_number(change):
    """Motor constants, limits and the payload are parameters: they are not even asked for."""
    assert cache_key(replace(ROBOT, **change), LAYOUT) == cache_key(ROBOT, LAYOUT)
