"""Both clients against a real server: what they give as data frames and arrays is what the server answers in JSON."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pandas as pd
import pytest

from armature import Application, ApplicationBuilder, AsyncClient, Client, MissingExtraError, NotFoundError
from armature.processes import Place, Service, running_service
from shared.settings import Settings
from tests.conftest import home_with_kernels

JOINTS = 6


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    home = home_with_kernels(tmp_path_factory.mktemp("clients") / "home")
    with running_service(Settings(home=home), Place(workers=2)) as service:
        yield service


def cell() -> ApplicationBuilder:
    """Two tasks that can be done, and one that cannot."""
    rest = [0.0] * JOINTS
    return (
        ApplicationBuilder("cell", robot="ur5")
        .transcription(scheme="radau", degree=1, intervals=12)
        .task("reach", start_rad=np.full(JOINTS, 0.4), end_rad=rest, payload_kg=1.5)
        .task("lift", start_rad=[0.2, 0.5, 0.1, 0, 0, 0.3], end_rad=rest)
        .task("too heavy", start_rad=[0.4] * JOINTS, end_rad=rest, payload_kg=400.0)
        .compare("empirical", task="reach")
    )


@pytest.fixture(scope="module")
def finished(service: Service) -> Iterator[Application]:
    """Submitted by the one client, and followed by the other."""

    async def follow(application_id: str) -> list[int]:
        seen: list[int] = []
        async with AsyncClient(service.url) as client:
            status = await client.application(application_id).wait(lambda found: seen.append(found.progress.done))
        assert status.state == "completed_with_failures"
        return seen

    with Client(service.url) as client:
        application = client.submit(cell())
        seen = asyncio.run(follow(application.id))
        assert seen == sorted(seen)
        yield application


@pytest.fixture
def answer(service: Service, finished: Application) -> Any:
    """JSON of a path below the application, by another client."""

    def get(path: str) -> Any:
        return httpx.get(f"{service.url}/v1/applications/{finished.id}{path}").raise_for_status().json()

    return get


def test_tasks_as_a_frame(finished: Application, answer: Any) -> None:
    """A row a motion; one that cannot be done has its reason."""
    frame = finished.results().tasks()
    assert list(frame.index) == [(k, method) for k in (0, 1) for method in ("own", "two_step", "empirical")] + [(2, "own")]  # fmt: skip # noqa: E501
    for task in answer("/tasks")["items"][:2]:
        for method, motion in ({"own": task["own"]} | task["methods"]).items():
            row = frame.loc[(task["index"], method)]
            assert row["final_time_s"] == motion["final_time_s"]
            assert row["kkt_residual"] == motion["certificate"]["kkt_residual"]
    failed = frame.loc[(2, "own")]
    assert pd.isna(failed["objective"])
    assert failed["reason"] == answer("/tasks/2")["reason"]


def test_regret_follows_from_the_tasks(finished: Application) -> None:
    """Worked out again from the frame of the tasks."""
    results = finished.results()
    values = results.tasks()["objective"].unstack("method").dropna()
    regret = results.regret().droplevel("name")
    for method in ("two_step", "empirical"):
        np.testing.assert_allclose(regret[method], values[method] / values["own"] - 1, atol=1e-15)
    totals = results.comparison()
    np.testing.assert_allclose(totals["total_objective"], values.sum()[totals.index], rtol=1e-15)
    assert totals.loc["empirical", "regret"] == pytest.approx(values["empirical"].sum() / values["own"].sum() - 1)


def test_designs_as_frames(finished: Application, answer: Any) -> None:
    results = finished.results()
    design, motors = results.design(), answer("/design")["motors"]
    assert list(design.index) == list(range(1, JOINTS + 1))
    assert design.loc[2, "L_mm"] == motors[1]["dimensions_mm"]["L"]
    assert design.loc[2, "flux_linkage_Wb"] == motors[1]["parameters"]["flux_linkage_Wb"]
    assert design.loc[2, "binding"] == ", ".join(motors[1]["binding"])
    designs = results.designs()
    np.testing.assert_allclose(
        designs.loc[("mean", "", 3)],
        (designs.loc[("own", "reach", 3)] + designs.loc[("own", "lift", 3)]) / 2,
        rtol=1e-12,
    )


def test_motions_as_frame_and_arrays(finished: Application, answer: Any) -> None:
    results = finished.results()
    arrays, motion = results.arrays(1, "own"), answer("/tasks/1/trajectory?method=own")
    np.testing.assert_array_equal(arrays["joint_torque_Nm"], motion["joint_torque_Nm"])
    frame = results.motion(1, "own")
    np.testing.assert_array_equal(frame.index, motion["time_s"])
    np.testing.assert_array_equal(frame["joint_torque_Nm_4"], arrays["joint_torque_Nm"][:, 3])


def test_the_async_client_gives_the_same(service: Service, finished: Application) -> None:
    """Every method of the results, asked at once."""

    async def ask() -> list[Any]:
        async with AsyncClient(service.url) as client:
            results = client.results(finished.id)
            asked = (results.tasks(), results.design(), results.designs(), results.comparison(), results.regret())
            return [*await asyncio.gather(*asked, results.motion(0)), await results.arrays(0)]

    *frames, arrays = asyncio.run(ask())
    results = finished.results()
    same = (results.tasks(), results.design(), results.designs(), results.comparison(), results.regret())
    for one, other in zip(frames, (*same, results.motion(0)), strict=True):
        pd.testing.assert_frame_equal(one, other)
    for name, values in results.arrays(0).items():
        np.testing.assert_array_equal(arrays[name], values)


def test_a_sweep_as_a_frame(service: Service, tmp_path: Path) -> None:
    """Submitted and followed by the async client; a row an application and method."""

    async def run() -> tuple[pd.DataFrame, list[float]]:
        async with AsyncClient(service.url) as client:
            base = cell().to_dict() | {"tasks": cell().to_dict()["tasks"][:1]}
            axes = {"tasks[0].payload_kg": [0.0, 1.0]}
            sweep = await client.submit_sweep({"name": "two", "application": base, "axes": axes})
            assert (await sweep.wait(timeout_s=120.0)).state == "succeeded"
            assert [item.id async for item in client.sweeps()] == [sweep.id]
            assert len(await sweep.applications()) == 2
            frame, points = await sweep.frame(), (await sweep.status()).points
            await sweep.delete()
        return frame, [point.totals["own"].time_s for point in points]

    frame, own_s = asyncio.run(run())
    np.testing.assert_allclose(frame.loc[frame["method"] == "own", "time_s"], own_s, rtol=1e-15)
    assert {"own", "two_step", "empirical"} <= set(frame["method"])
    assert sorted(set(frame["tasks[0].payload_kg"])) == [0.0, 1.0]


def test_what_there_is_not(service: Service, finished: Application, monkeypatch: pytest.MonkeyPatch) -> None:
    """No such application; and no pandas, which says what to install, while arrays need none."""
    with Client(service.url) as client, pytest.raises(NotFoundError, match="nothing"):
        client.results("nothing").tasks()
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'armature-codesign\[tables\]'"):
        finished.results().tasks()
    assert finished.results().arrays(0)["time_s"][0] == 0.0
