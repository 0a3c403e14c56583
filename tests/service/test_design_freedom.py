"""What a design may choose beside lengths, from the request to the designs, motions and comparison."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from sqlalchemy import Engine

from services.codesign.motor import evaluate_motor
from services.codesign.motor_data import MotorData
from services.codesign.problem import Transcription
from services.codesign.solve import solve
from services.jobs import results, views
from services.jobs.resolve import resolve
from services.jobs.resolved import ResolvedApplication
from services.jobs.submit import submit
from shared.contracts.errors import InvalidInputError
from shared.settings import Settings
from tests.service.requests import application
from tests.service.test_shared_optimum import request, run

METHODS = ("two_step", "empirical", "worst_case", "shared_optimum")


@pytest.fixture
def database_url(tmp_path: Any) -> str:
    """SQLite alone: what is tested here is not the database."""
    return f"sqlite:///{tmp_path / 'armature.db'}"


def resolved(design: dict[str, Any], **changes: Any) -> ResolvedApplication:
    return resolve(application(design=design, **changes), lambda _: None, 100)


def test_free_gears_from_the_request_to_the_comparison(engine: Engine, settings: Settings) -> None:
    """Every design has its ratios, every motion was solved with its design's, and the best is better than 100:1."""
    totals = {}
    for name, design in (("free", {"gear_ratios": {"all": [60, 160], "6": [100, 100]}}), ("fixed", {})):
        application_id, _ = submit(engine, settings, request(design=design))
        run(engine)
        totals[name] = results.comparison(engine, application_id).methods["shared_optimum"].weighted_objective
        if name == "fixed":
            assert results.design(engine, application_id).gear_ratio is None
            continue
        designs = results.designs(engine, application_id)
        own = np.array([task.gear_ratio for task in designs.tasks])
        assert ((own > 59.99) & (own < 160.01)).all()
        np.testing.assert_allclose(own[:, 5], 100.0, rtol=1e-6)
        np.testing.assert_allclose(designs.mean.gear_ratio, np.average(own, axis=0, weights=[2.0, 1.0]), rtol=1e-12)
        for method in METHODS:
            motion = results.trajectory(engine, application_id, 0, method)
            found = results.design(engine, application_id, method)
            np.testing.assert_array_equal(motion.gear_ratio, found.gear_ratio)
            assert [sheet["gear_ratio"] for sheet in found.motors] == found.gear_ratio
            speeds = np.abs(motion.joint_speed_rad_s).max(axis=0) * np.array(found.gear_ratio)
            assert speeds.max() <= 100 * np.pi * (1 + 1e-6)
        problem = results.inputs(engine, application_id).build_problem(
            0, np.array(found.design_mm) * 1e-3, np.array(found.gear_ratio)
        )
        stored = results.comparison(engine, application_id).methods["shared_optimum"].per_task[0]["objective"]
        cold = solve(problem).objective
        assert cold is not None
        assert stored <= cold * (1 + 1e-6)  # which may end in a neighbouring optimum
    assert totals["free"] < 0.99 * totals["fixed"]


def test_identical_motors_in_every_design(engine: Engine, settings: Settings) -> None:
    groups, totals = [[1, 2, 3], [4, 5, 6]], {}
    for name, design in (("alike", {"identical": groups}), ("free", {})):
        application_id, _ = submit(engine, settings, request(design=design))
        run(engine)
        totals[name] = results.comparison(engine, application_id).methods["shared_optimum"].weighted_objective
        if name == "free":
            continue
        for method in METHODS:
            rows = results.design(engine, application_id, method).design_mm
            for group in groups:
                assert all(rows[joint - 1] == rows[group[0] - 1] for joint in group), method
    assert totals["alike"] > totals["free"]


def test_a_motion_with_free_gears_keeps_the_default_accuracy(engine: Engine, settings: Settings) -> None:
    """Certified by the replay, which takes its gears from the design."""
    asked = application(design={"gear_ratios": {2: [60, 160]}}, tasks=application().tasks[:1])
    application_id, _ = submit(engine, settings, asked)
    run(engine)
    motion = results.trajectory(engine, application_id, 0, None)
    assert motion.gear_ratio[1] != pytest.approx(100.0, rel=1e-3)
    assert motion.gear_ratio[0] == 100.0
    assert Transcription("radau", 3, 50, "current").degree == motion.degree


def test_the_search_begins_within_the_bounds() -> None:
    asked = resolved({"gear_ratios": {"2": [150, 200], "3": [20, 50]}})
    assert asked.build_problem(0).robot.gear_ratio.tolist() == [100, 150, 50, 100, 100, 100]


def test_as_a_request_it_means_the_same() -> None:
    asked = resolved({"gear_ratios": {"2": [150, 200]}, "identical": [[4, 5, 6]]})
    again = resolve(type(application())(**asked.as_request("again")), lambda _: None, 100)
    assert again.freedom == asked.freedom
    assert "design" not in resolved({}).as_request("plain")


@pytest.mark.parametrize(
    ("design", "field", "limit"),
    [
        ({"gear_ratios": {"7": [50, 60]}}, "design.gear_ratios", "1 to 6"),
        ({"gear_ratios": {"elbow": [50, 60]}}, "design.gear_ratios", "joint's number"),
        ({"gear_ratios": {"2": [50]}}, "design.gear_ratios.2", "[low, high]"),
        ({"gear_ratios": {"2": [-50, 60]}}, "design.gear_ratios.2", "0 < low <= high"),
        ({"identical": [[1, 2], [2, 3]]}, "design.identical", "twice"),
        ({"identical": [[0, 1]]}, "design.identical", "1 to 6"),
    ],
)
def test_what_makes_no_sense_is_refused(design: dict[str, Any], field: str, limit: str) -> None:
    with pytest.raises(InvalidInputError) as refused:
        resolved(design)
    (error,) = refused.value.errors
    assert error.field == field
    assert limit in error.limit


def test_a_joint_that_moves_at_the_ends_has_no_free_gear() -> None:
    moving = [task.model_dump() | {"end_speed_rad_s": [0, 0.1, 0, 0, 0, 0]} for task in application().tasks[:1]]
    with pytest.raises(InvalidInputError) as refused:
        resolved({"gear_ratios": {"2": [50, 150]}}, tasks=moving)
    assert [error.field for error in refused.value.errors] == ["tasks[0].end_speed_rad_s[1]"]


STEPS_MM = {"L": 5, "R_ro": 1, "R_so": 1, "h_m": 0.5, "h_sy": 0.5, "w_tooth": 0.5, "b_0": 0.5}


@pytest.mark.parametrize("method", ["two_step", "shared_optimum"])
def test_a_design_on_a_catalogues_steps_and_what_it_costs(engine: Engine, settings: Settings, method: str) -> None:
    """Snapped from the best design there is; its motions are solved again, and the comparison shows the loss."""
    design = {"catalogue": {"steps_mm": STEPS_MM}, "identical": [[4, 5, 6]]}
    application_id, _ = submit(engine, settings, request(method=method, design=design, compare=[]))
    run(engine)
    compared = results.comparison(engine, application_id)
    assert set(compared.methods) == {"own", "two_step", "catalogue", method}
    assert not compared.missing
    found = results.designs(engine, application_id).methods["catalogue"]
    assert found.source == method
    assert found.distance > 0
    steps = np.array(list(STEPS_MM.values()))
    multiples = np.array(found.design_mm) / steps
    np.testing.assert_allclose(multiples, np.round(multiples), atol=1e-9)
    assert found.design_mm[3] == found.design_mm[4] == found.design_mm[5]
    source, snapped = compared.methods[method], compared.methods["catalogue"]
    assert snapped.weighted_objective > compared.methods["own"].weighted_objective
    if method == "shared_optimum":
        assert snapped.weighted_objective > source.weighted_objective
    assert compared.regret["catalogue"].total is not None
    status = views.status(engine, application_id)
    assert status.progress.done == status.progress.total


def test_named_motors_are_named_in_the_design(engine: Engine, settings: Settings) -> None:
    names = list(STEPS_MM)
    motors = [
        {"name": name, "dimensions_mm": dict(zip(names, lengths, strict=True))}
        for name, lengths in (
            ("small", [30, 22, 46, 3, 7, 8.5, 3]),
            ("large", [50, 22, 46, 3, 7, 8.5, 3]),
            ("too heavy", [100, 40, 80, 3, 7, 9, 3]),
        )
    ]
    asked = request(design={"catalogue": {"motors": motors}}, method="catalogue", compare=[])
    application_id, _ = submit(engine, settings, asked)
    run(engine)
    found = results.designs(engine, application_id).methods["catalogue"]
    assert found.entries is not None
    assert set(found.entries) <= {"small", "large"}
    lengths = {motor["name"]: list(motor["dimensions_mm"].values()) for motor in motors}
    np.testing.assert_allclose(found.design_mm, [lengths[name] for name in found.entries], rtol=1e-12)
    assert results.design(engine, application_id).method == "catalogue"


def test_a_catalogue_without_a_motor_that_can_be_built_is_said(engine: Engine, settings: Settings) -> None:
    heavy = {"name": "heavy", "dimensions_mm": dict(zip(STEPS_MM, [100, 40, 80, 3, 7, 9, 3], strict=True))}
    asked = request(design={"catalogue": {"motors": [heavy]}}, method="two_step", compare=[])
    application_id, _ = submit(engine, settings, asked)
    run(engine)
    status = views.status(engine, application_id)
    assert status.state == "completed_with_failures"
    assert "catalogue" in (status.reason or "")
    assert "catalogue" in results.comparison(engine, application_id).missing


def test_a_tie_break_makes_every_own_design_lighter(engine: Engine, settings: Settings) -> None:
    masses = []
    for design in ({}, {"tie_break": {"by": "mass", "tolerance": 1e-3}}):
        application_id, _ = submit(engine, settings, request(design=design, method="two_step", compare=[]))
        run(engine)
        sheets = [np.array(task.design_mm) * 1e-3 for task in results.designs(engine, application_id).tasks]
        masses.append([sum(evaluate_motor(row, MotorData())[1]["mass_kg"] for row in sheet) for sheet in sheets])
    plain, light = np.array(masses)
    assert (light < 0.97 * plain).all()


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"method": "catalogue"}, "design.catalogue"),
        ({"design": {"tie_break": {"by": "nearest"}}}, "design.tie_break.nearest_to_mm"),
        ({"design": {"tie_break": {"nearest_to_mm": [[1.0] * 7] * 6}}}, "design.tie_break.nearest_to_mm"),
        ({"design": {"tie_break": {"by": "nearest", "nearest_to_mm": [[1.0] * 7]}}}, "design.tie_break.nearest_to_mm"),
    ],
)
def test_what_belongs_together_must_come_together(changes: dict[str, Any], field: str) -> None:
    with pytest.raises(InvalidInputError) as refused:
        resolve(application(**changes), lambda _: None, 100)
    assert [error.field for error in refused.value.errors] == [field]


def test_the_arm_as_it_is_asked_to_be() -> None:
    """Lighter, longer and with other gears; a sweep may run over each."""
    changes = {"link_mass_scale": 0.5, "link_length_scale": 2.0, "gear_ratio": 80}
    changed = resolve(application(robot_changes=changes), lambda _: None, 100).arm
    plain = resolve(application(), lambda _: None, 100).arm
    np.testing.assert_allclose(changed.link_mass, plain.link_mass / 2)
    np.testing.assert_allclose(changed.link_inertia, plain.link_inertia * 2)
    np.testing.assert_allclose(changed.tool_home[:3, 3], plain.tool_home[:3, 3] * 2)
    assert changed.gear_ratio.tolist() == [80] * 6


def test_the_arm_is_built_once_and_does_not_count_in_comparisons() -> None:
    first, same = (resolve(application(), lambda _: None, 100) for _ in range(2))
    assert first.arm is first.arm
    assert first.arm is not same.arm
    assert first == same
    assert first != resolve(application(robot_changes={"gear_ratio": 80}), lambda _: None, 100)
