"""Arms of 1, 2, 3 and 7 joints through everything: client, server, worker, shared optimum, results, tables, figures."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from armature.client import Client
from armature.processes import Place, Service, running_service
from armature.save import save_results
from services.report.answers import read_answers
from services.report.figures import write_figures
from shared.settings import Settings
from tests.acceptance.cli import armature
from tests.conftest import home_with_kernels
from tests.numerics.urdfs import robot

QUICK = {"scheme": "radau", "degree": 1, "intervals": 10, "control": "voltage"}

pytestmark = pytest.mark.timeout(600)


def planar_arm(joints: int) -> dict:
    """A robot of light, short links in a row, as the text of a URDF."""
    parts = [
        f'<link name="l{k + 1}"><inertial><origin xyz="0.1 0 0"/><mass value="1.0"/>'
        '<inertia ixx="0.001" iyy="0.004" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        f'<joint name="j{k + 1}" type="continuous"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<origin xyz="{0.2 if k else 0} 0 0"/><axis xyz="0 {k % 2} {1 - k % 2}"/></joint>'
        for k in range(joints)
    ]
    return {"urdf": robot('<link name="l0"/>', *parts, name=f"row_of_{joints}"), "gear_ratio": 100.0}


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    home = home_with_kernels(tmp_path_factory.mktemp("joints") / "home")
    with running_service(Settings(home=home), Place(workers=2)) as service:
        yield service


@pytest.mark.parametrize("joints", [1, 2, 3, 7])
def test_from_a_urdf_to_figures(joints: int, service: Service, tmp_path: Path) -> None:
    request = {
        "name": f"{joints} joints",
        "robot": planar_arm(joints) if joints < 7 else "gen3",
        "tasks": {"grid": {"stroke": [0.2, 0.3], "payload_kg": [0, 1]}},
        "transcription": QUICK,
        "method": "two_step",
        "compare": ["empirical", "shared_optimum"],
    }
    with Client(service.url) as client:
        application = client.submit(request)
        status = application.wait(timeout_s=400)
        assert status.state == "succeeded", (status, [task.reason for task in application.tasks()])
        assert [motor["joint"] for motor in application.design().motors] == list(range(1, joints + 1))
        trajectory = application.trajectory(3)
        assert {len(row) for row in trajectory.joint_position_rad} == {joints}
        regret = application.comparison().regret
        assert {"two_step", "empirical", "shared_optimum"} <= set(regret)
        folder = save_results(application, tmp_path, request)
    answers = read_answers(folder)
    assert answers.robot is not None
    assert answers.robot.joints == joints
    assert write_figures(answers, tmp_path / "figures")
    shown = armature(service.logs.parent, "design", status.id, "--url", service.url)
    assert shown.returncode == 0, shown.stderr
    asked = armature(service.logs.parent, "tasks", status.id, "--url", service.url, "--json")
    assert len(json.loads(asked.stdout)["items"]) == 4
