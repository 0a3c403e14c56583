"""`armature sweep`: worked through here, and on a server."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest
import yaml

from armature.processes import Place, running_service
from shared.settings import Settings
from tests.acceptance.cli import QUICK, armature, processes_of

SWEEP = {
    "name": "two weights",
    "application": "base.yaml",
    "axes": {"objective.alpha": [0.0, 0.4]},
}
BASE = {
    "name": "one move",
    "objective": {"kind": "weighted"},
    "transcription": QUICK,
    "tasks": [{"name": "lift", "start_rad": [0.4] * 6, "end_rad": [0.0] * 6}],
}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A sweep whose base application is a file of its own."""
    (tmp_path / "base.yaml").write_text(yaml.safe_dump(BASE), encoding="utf-8")
    path = tmp_path / "sweep.yaml"
    path.write_text(yaml.safe_dump(SWEEP, sort_keys=False), encoding="utf-8")
    return path


def test_a_sweep_is_run_here(home: Path, file: Path, tmp_path: Path) -> None:
    """More weight on energy takes longer and needs less of it; the folder has what is on the screen."""
    done = armature(home, "sweep", "run", file, "--out", tmp_path / "out", "--csv")
    assert done.returncode == 0, done.stderr
    rows = [row for row in csv.DictReader(io.StringIO(done.stdout)) if row["method"] == "two_step"]
    fast, frugal = rows
    assert [row["objective.alpha"] for row in rows] == ["0.0", "0.4"]
    assert float(fast["time_s"]) < float(frugal["time_s"])
    assert float(fast["energy_V2s"]) > float(frugal["energy_V2s"])
    (folder,) = (tmp_path / "out").iterdir()
    assert folder.name.startswith("two-weights-")
    assert (folder / "sweep.csv").read_text(encoding="utf-8").splitlines() == done.stdout.splitlines()
    table = json.loads((folder / "sweep.json").read_text(encoding="utf-8"))
    assert table["points"][1]["totals"]["two_step"]["time_s"] == float(frugal["time_s"])
    assert "svg" in (folder / "front.svg").read_text(encoding="utf-8")
    assert processes_of(home) == []


def test_a_sweep_on_a_server(home: Path, file: Path) -> None:
    with running_service(Settings(home=home), Place(workers=1)) as service:

        def sweep(*arguments: str | Path) -> str:
            done = armature(home, "sweep", *arguments, "--url", service.url)
            assert done.returncode == 0, done.stderr
            return done.stdout

        sweep_id = sweep("submit", file).strip()
        (watched,) = (line for line in sweep("watch", sweep_id).splitlines() if line.startswith("0.4"))
        assert watched.split()[1:5] == ["succeeded", "1", "of", "1"]
        assert json.loads(sweep("show", sweep_id, "--json"))["state"] == "succeeded"
        assert "two weights" in sweep("list")
        long = file.with_name("long.yaml")
        axes = {"objective.alpha": [k / 100 for k in range(60)]}
        long.write_text(yaml.safe_dump(SWEEP | {"axes": axes}), encoding="utf-8")
        other = json.loads(sweep("submit", long, "--json"))
        assert other["applications"] == 60
        sweep("cancel", other["id"])
        cancelled = armature(home, "sweep", "watch", other["id"], "--url", service.url)
        assert cancelled.returncode == 12
        sweep("delete", sweep_id, "--yes")
        assert [item["id"] for item in json.loads(sweep("list", "--json"))["items"]] == [other["id"]]


def test_the_wrong_kind_of_file_is_named(home: Path, file: Path) -> None:
    done = armature(home, "run", file)
    assert done.returncode == 3
    assert "is a sweep, not an application" in done.stderr
    done = armature(home, "sweep", "run", file, "--json", "--csv")
    assert done.returncode == 2
    assert "give --json or --csv, not both" in done.stderr
