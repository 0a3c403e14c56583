"""A robot from a file: refused with what is wrong in it, or kept, chosen, solved with, and seen in motion."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import httpx
from playwright.sync_api import Page, expect

from tests.web.browser import Watched
from tests.web.conftest import QUICK, ended

URDF = Path(__file__).parents[2] / "examples" / "my_arm.urdf"


def test_a_urdf_is_uploaded_and_its_arm_moves(page: Page, watched: Watched, http: httpx.Client, tmp_path: Path) -> None:
    """Three joints, axes of any direction."""
    watched.expected = ("422",)
    page.goto("/#/submit")
    robot = page.get_by_label("Robot", exact=True)
    expect(robot).to_have_value("ur5")
    page.get_by_text("A robot of my own").click()
    wrong = tmp_path / "slide.urdf"
    wrong.write_text(URDF.read_text().replace('type="continuous"', 'type="prismatic"'))
    page.get_by_label("File").set_input_files(wrong)
    page.get_by_role("button", name="Upload").click()
    expect(page.get_by_role("alert")).to_contain_text("joint 'yaw' is prismatic")

    page.get_by_label("File").set_input_files(URDF)
    page.get_by_role("button", name="Upload").click()
    expect(page.get_by_role("status").filter(has_text="kept as")).to_be_visible()
    chosen = robot.input_value()
    assert len(http.get(f"/v1/robots/{chosen}").json()["gear_ratio"]) == 3

    task = {"name": "lift", "start_rad": [0.3, 0.4, 0.4], "end_rad": [0, 0, 0]}
    body = {"name": "my arm", "robot": chosen, "tasks": [task], "transcription": QUICK}
    application = http.post("/v1/applications", json=body).json()["id"]
    page.goto(f"/#/applications/{application}")
    expect(page.locator(".head .state")).to_contain_text("done", timeout=60_000)
    page.goto(f"/#/applications/{application}/tasks/0")
    expect(page.get_by_role("img", name=re.compile("^The arm in motion"))).to_be_visible()
    page.goto(f"/#/applications/{application}/design")
    expect(page.get_by_role("group", name="Motors, all to one scale").get_by_role("button")).to_have_count(3)


ONE_JOINT = """<robot name="one">
  <link name="base"/>
  <link name="arm"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="j" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.1"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="3" effort="100"/></joint>
</robot>"""


def test_the_motion_of_one_joint_is_readable(page: Page, http: httpx.Client) -> None:
    """Its curves are no larger than those of six joints may get, and no two times below them overlap."""
    task = {"start_rad": [1.0], "end_rad": [0]}
    robot = {"urdf": ONE_JOINT, "gear_ratio": 100}
    body = {"name": "one joint", "robot": robot, "tasks": [task], "transcription": QUICK}
    application = ended(http, http.post("/v1/applications", json=body).json()["id"])
    page.goto(f"/#/applications/{application}/tasks/0")
    for joint in ("all joints", "1"):
        page.get_by_role("group", name="Joint").get_by_text(joint, exact=True).click()
        panels = page.locator(".motion-grid svg")
        expect(panels).to_have_count(5)
        assert panels.first.bounding_box()["width"] <= 400  # type: ignore[index]
        boxes = [label.bounding_box() for label in panels.first.locator("text").all()]
        lowest = max(box["y"] for box in boxes if box)
        times = sorted((box["x"], box["width"]) for box in boxes if box and box["y"] > lowest - 2)
        assert len(times) >= 2
        for (x, width), (after, _) in pairwise(times):
            assert x + width < after
