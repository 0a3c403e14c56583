"""The design as people read it."""

from __future__ import annotations

import json

import numpy as np
import pytest

from services.codesign.design_sheet import design_sheet, motor_sheet
from services.codesign.motor import evaluate_motor
from services.codesign.motor_data import CONSTRAINTS, MotorData
from tests.numerics.tasks import solved

MOTOR = MotorData()


def test_every_motor_with_its_dimensions_and_parameters():
    design = solved(0.6, 2.0).design
    sheet = json.loads(json.dumps(design_sheet(design, MOTOR)))
    assert [entry["joint"] for entry in sheet["motors"]] == [1, 2, 3, 4, 5, 6]
    for row, entry in zip(design, sheet["motors"], strict=True):
        assert list(entry["dimensions_mm"].values()) == pytest.approx((row * 1e3).tolist(), rel=1e-12)
        parameters, _ = evaluate_motor(row, MOTOR)
        assert entry["parameters"]["flux_linkage_Wb"] == parameters.flux_linkage
        assert entry["parameters"]["torque_limit_Nm"] == pytest.approx(1.5 * 4 * parameters.flux_linkage * 3)


def test_slack_is_positive_inside_and_binding_is_small_slack():
    """The optimum for (0.6, 2 kg) makes the motor of joint 2 as long and as heavy as it may be."""
    entry = design_sheet(solved(0.6, 2.0).design, MOTOR)["motors"][1]
    assert "mass" in entry["binding"]
    assert "L_max" in entry["binding"]
    assert "L_min" not in entry["binding"]
    for name, limit in entry["constraints"].items():
        assert limit["slack"] > -1e-6 * limit["limit"]
        assert (limit["slack"] < 1e-3 * limit["limit"]) == (name in entry["binding"])


def test_wire_is_shown_by_its_diameter():
    design = solved(0.6, 2.0).design[3]
    entry, (_, values) = motor_sheet(3, design, MOTOR), evaluate_motor(design, MOTOR)
    wire = entry["constraints"]["wire_diameter"]
    assert wire["value"] == pytest.approx(np.sqrt(values["wire_diameter_squared_mm2"]), rel=1e-12)
    assert wire["value"] == pytest.approx(entry["parameters"]["wire_diameter_mm"], rel=1e-12)
    assert (wire["limit"], wire["unit"]) == (pytest.approx(0.6), "mm")


def test_broken_limits_have_negative_slack():
    """Table I's own motor has 30 turns and a wire of 0.508 mm."""
    too_long = np.array([0.2, 0.02, 0.045, 0.003, 0.007, 0.009, 0.003])
    entry = motor_sheet(0, too_long, MOTOR)
    assert entry["constraints"]["L_max"]["slack"] == pytest.approx(-100)
    assert entry["constraints"]["mass"]["slack"] < 0
    assert {"L_max", "mass"} <= set(entry["binding"])


def test_names_follow_the_constraints_of_the_program():
    entry = motor_sheet(0, solved(0.6, 2.0).design[0], MOTOR)
    names = [name for name in entry["constraints"] if not name.endswith(("_min", "_max"))]
    assert [c.startswith(name) for name, c in zip(names, CONSTRAINTS, strict=True)] == [True] * len(CONSTRAINTS)
    units = {"tooth_width": "rad", "mass": "kg", "tooth_flux_density": "T", "slot_height": "mm"}
    assert {name: entry["constraints"][name]["unit"] for name in units} == units
