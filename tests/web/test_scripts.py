"""What the pages compute, against the same computed here."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml
from playwright.sync_api import Page
from scipy.linalg import expm

from services.codesign.motor_data import DIMENSIONS, MotorData
from services.codesign.robot import Robot, preset_wire
from services.report.section_geometry import motor_section, polygon_area

TO_ROUNDING = 1e-12
ARC_TOLERANCE = 1e-3
"""The page draws arcs with fewer chords than the report."""


def call(page: Page, module: str, function: str, *arguments: Any) -> Any:
    """Call a function of one of the page's modules."""
    script = "([module, name, args]) => import(`/dashboard/js/${module}`).then((m) => m[name](...args))"
    return page.evaluate(script, [module, function, list(arguments)])


@pytest.fixture
def scripts(page: Page) -> Page:
    """Any page that may load the modules."""
    page.goto("/")
    return page


def test_the_arm_stands_where_matrix_exponentials_put_it(scripts: Page) -> None:
    """Product of exponentials with scipy's expm, for random angles."""
    robot = Robot.preset("ur5")
    angles = np.random.default_rng(1).uniform(-2, 2, robot.joints)
    pose, motors = np.eye(4), []
    for k, (wx, wy, wz, *v) in enumerate(robot.screw_axes):
        motors.append((pose @ [*robot.motor_position[k], 1])[:3])
        twist = np.zeros((4, 4))
        twist[:3, :3] = [[0, -wz, wy], [wz, 0, -wx], [-wy, wx, 0]]
        twist[:3, 3] = v
        pose = pose @ expm(twist * angles[k])
    drawn = call(scripts, "arm/kinematics.js", "armAt", preset_wire("ur5"), angles.tolist())
    np.testing.assert_allclose(drawn["tool"], (pose @ robot.tool_home)[:3, 3], atol=TO_ROUNDING)
    np.testing.assert_allclose([motor["at"] for motor in drawn["motors"]], motors, atol=TO_ROUNDING)


def test_a_drawn_motor_has_the_areas_of_the_report(scripts: Page) -> None:
    """Slots, magnets and openings of a design, from two ways to draw them."""
    design = dict(zip(DIMENSIONS, (60.0, 20.0, 40.0, 3.0, 6.0, 6.0, 2.0), strict=True))
    drawn = call(scripts, "motor/section.js", "motorSection", design, MotorData().to_wire())
    expected = motor_section(list(design.values()), MotorData())
    assert drawn["slotOuter"] == pytest.approx(expected.slot_outer_radius)
    for kind in ("slots", "openings", "magnets"):
        areas = [polygon_area(np.array(outline)) for outline in drawn[kind]]
        wanted = [polygon_area(outline) for outline in getattr(expected, kind)]
        np.testing.assert_allclose(areas, wanted, rtol=ARC_TOLERANCE)


def test_quartiles_are_numpys(scripts: Page) -> None:
    """With values beyond the whiskers."""
    values = [*np.random.default_rng(2).normal(size=23).tolist(), 9.0]
    box = call(scripts, "plots/boxes.js", "quartiles", values)
    np.testing.assert_allclose([box["low"], box["median"], box["high"]], np.percentile(values, [25, 50, 75]))
    assert 9.0 in box["beyond"]


def test_yaml_that_the_form_writes_is_read_back_the_same(scripts: Page) -> None:
    """Names that look like something else are quoted."""
    content = {
        "name": "yes",
        "tags": ["on", "1e3", "a: b", " x"],
        "motor": {"bounds_mm": {"L": [20, 100]}},
        "tasks": [{"name": "#1", "start_rad": [0.1, -0.5], "payload_kg": 2}, {"name": "- x", "end_rad": [0]}],
        "objective": {},
    }
    assert yaml.safe_load(call(scripts, "submit/yaml.js", "toYaml", content)) == content


@pytest.mark.parametrize(
    ("value", "printed"),
    [(0.00012345, "1.23×10⁻⁴"), (-2.5, "−2.5"), (8.2352, "8.235"), (0, "0"), (None, "–")],
)
def test_numbers_are_printed_for_people(scripts: Page, value: float | None, printed: str) -> None:
    """A true minus, four digits, powers of ten where they are needed."""
    assert call(scripts, "format.js", "number", value) == printed


def test_a_column_has_the_same_decimals(scripts: Page) -> None:
    """As many as give the largest four digits; with the unit."""
    narrow_space = "\u202f"
    assert call(scripts, "format.js", "aligned", [0.98, 8.125], "s") == [
        f"0.980{narrow_space}s",
        f"8.125{narrow_space}s",
    ]
    assert call(scripts, "format.js", "aligned", [-12.5, 204400], "1") == ["−13", "204400"]


def test_a_field_is_found_in_yaml(scripts: Page) -> None:
    """The second task's start, not the first's; and a field inside braces."""
    text = (
        "name: x\ntasks:\n  - name: a\n    start_rad: [0]\n  - name: b\n    start_rad: [9]\nobjective: {kind: time}\n"
    )
    assert call(scripts, "submit/yaml.js", "lineOf", text, "tasks[1].start_rad[0]") == 5
    assert call(scripts, "submit/yaml.js", "lineOf", text, "objective.kind") == 6
    assert call(scripts, "submit/yaml.js", "lineOf", text, "nothing") == -1
