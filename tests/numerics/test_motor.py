"""The motor model against published values, reference samples and a winding computed from its conductors."""

from __future__ import annotations

import json
import math
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from services.codesign.motor import (
    constraint_limits,
    design_constraints,
    evaluate_motor,
    motor_parameters,
    motor_torque,
    steady_voltages,
)
from services.codesign.motor_data import COEFFICIENTS, CONSTRAINTS, DIMENSIONS, MotorData, MotorDataError

SAMPLES = json.loads((Path(__file__).parents[1] / "data" / "motors.json").read_text())["samples"]
TABLE_I_MM = np.array([20, 18, 30, 3, 5, 7, 2])

REFERENCE = 1e-9
"""Relative; two implementations of the same closed formulas differ by rounding alone (1e-15 times cancellation)."""
PHASOR = 1e-12
"""Absolute; sums of a few dozen unit phasors."""
TABULATED = 5e-4
"""Half of the last digit of winding factors tabulated to three decimals."""


def sample_id(sample: dict[str, object]) -> str:
    return f"{sample['design_mm']}-{sample['turns_per_tooth']}"


@pytest.mark.parametrize("sample", SAMPLES, ids=sample_id)
def test_parameters_equal_the_reference(sample):
    data = MotorData(turns_per_tooth=sample["turns_per_tooth"])
    motor, _ = evaluate_motor(np.array(sample["design_mm"]) * 1e-3, data)
    expected = {
        "phase_resistance": sample["phase_resistance_ohm"],
        "inductance": sample["inductance_H"],
        "flux_linkage": sample["flux_linkage_Wb"],
        "stator_mass": sample["stator_mass_kg"],
        "rotor_mass": sample["rotor_mass_kg"],
        "stator_inertia_axial": sample["stator_inertia_axial_kg_m2"],
        "stator_inertia_transverse": sample["stator_inertia_transverse_kg_m2"],
        "rotor_inertia_axial": sample["rotor_inertia_axial_kg_m2"],
        "rotor_inertia_transverse": sample["rotor_inertia_transverse_kg_m2"],
        "slot_height": sample["slot_height_m"],
        "coil_area": sample["coil_area_m2"],
    }
    assert {name: getattr(motor, name) for name in expected} == pytest.approx(expected, rel=REFERENCE)


@pytest.mark.parametrize("sample", SAMPLES, ids=sample_id)
def test_constraints_equal_the_reference(sample):
    data = MotorData(turns_per_tooth=sample["turns_per_tooth"])
    _, values = evaluate_motor(np.array(sample["design_mm"]) * 1e-3, data)
    lower, upper = constraint_limits(data)
    residuals = [
        value - high if math.isfinite(high) else low - value
        for value, low, high in zip(values.values(), lower, upper, strict=True)
    ]
    expected = list(sample["constraint_residuals"].values())
    assert residuals == pytest.approx(expected, rel=REFERENCE)


def test_table_one_to_its_printed_digits():
    motor, _ = evaluate_motor(TABLE_I_MM * 1e-3, MotorData(turns_per_tooth=30))
    assert f"{motor.flux_linkage:.4f}" == "0.0288"
    assert f"{motor.inductance * 1e3:.3f}" == "0.698"
    assert f"{motor.phase_resistance:.3f}" == "0.621"


def test_table_one_decides_the_turns_resistance_flux_limit_and_wire():
    """Departures 1, 2, 3 and 5: what the printed text would give for the paper's own motor."""
    thirty, constraints = evaluate_motor(TABLE_I_MM * 1e-3, MotorData(turns_per_tooth=30))
    fifty, _ = evaluate_motor(TABLE_I_MM * 1e-3, MotorData(turns_per_tooth=50))
    assert fifty.flux_linkage == pytest.approx(0.0481, abs=5e-5)  # not 0.0288: Table I has 30 turns
    assert thirty.phase_resistance / 2 == pytest.approx(0.310, abs=5e-4)  # R_1 as printed
    L, h_sy, w_tooth = TABLE_I_MM[[0, 4, 5]] * 1e-3
    k_p = MotorData().pitch_factor
    assert k_p * thirty.flux_linkage / (w_tooth * L) == pytest.approx(178, abs=0.5)  # tesla, as printed
    assert constraints["tooth_flux_density_T"] == pytest.approx(1.487, abs=5e-4)
    assert constraints["yoke_flux_density_T"] == pytest.approx(1.202, abs=5e-4)
    assert math.sqrt(constraints["wire_diameter_squared_mm2"]) == pytest.approx(0.508, abs=5e-4)
    assert constraints["yoke_flux_density_T"] / constraints["tooth_flux_density_T"] == pytest.approx(
        w_tooth / (math.sqrt(3) * h_sy), rel=REFERENCE
    )


def test_constraint_names_limits_and_values_are_in_one_order():
    data = MotorData(wire_diameter_min=0.7e-3, mass_limit=2.0, slot_height_min=0.2e-3, flux_density_limit=1.4)
    lower, upper = (dict(zip(CONSTRAINTS, limit.tolist(), strict=True)) for limit in constraint_limits(data))
    assert upper["tooth_width_rad"] == math.pi / data.slots
    assert lower["slot_height_mm"] == pytest.approx(0.2)
    assert upper["mass_kg"] == 2.0
    assert lower["wire_diameter_squared_mm2"] == pytest.approx(0.49)
    assert upper["tooth_flux_density_T"] == upper["yoke_flux_density_T"] == 1.4
    unlimited = [lower[name] for name in CONSTRAINTS if upper[name] < math.inf]
    unlimited += [upper[name] for name in CONSTRAINTS if lower[name] > -math.inf]
    assert np.isinf(unlimited).all()
    assert len(unlimited) == len(CONSTRAINTS)


def test_masses_by_volume():
    """Iron, copper and nothing else: stator ring, less its copper windows, plus the copper of Q coils."""
    data = MotorData()
    L, R_ro, R_so, _, h_sy, w_tooth, _ = TABLE_I_MM * 1e-3
    motor, _ = evaluate_motor(TABLE_I_MM * 1e-3, data)
    ring = math.pi * (R_so**2 - R_ro**2) * L
    inner, outer = R_ro + data.air_gap + data.tooth_tip_height, R_so - h_sy
    slots = math.pi * (outer**2 - inner**2) - data.slots * w_tooth * (outer - inner)
    turn = 2 * L + w_tooth * (2 - math.pi / 2) + math.pi / 2 * (2 * math.pi * (R_ro + data.air_gap) / data.slots)
    copper = data.slots * data.turns_per_tooth * motor.coil_area * turn
    iron = ring - data.filling_factor * slots * L
    assert motor.stator_mass == pytest.approx(data.iron_density * iron + data.copper_density * copper, rel=REFERENCE)
    assert motor.rotor_mass == pytest.approx(data.iron_density * math.pi * R_ro**2 * L, rel=REFERENCE)


def test_motor_equations_conserve_power():
    """Departure 4: power in = copper + d/dt field + shaft, which the printed torque breaks."""
    motor, _ = evaluate_motor(TABLE_I_MM * 1e-3, MotorData())
    P, i_d, i_q, di_d, di_q, omega = 4, -1.3, 2.1, 400.0, -700.0, 180.0
    steady_d, steady_q = steady_voltages(i_d, i_q, omega, motor, P)
    u_d, u_q = steady_d + motor.inductance * di_d, steady_q + motor.inductance * di_q
    supplied = 1.5 * (u_d * i_d + u_q * i_q)
    copper = 1.5 * motor.phase_resistance * (i_d**2 + i_q**2)
    field = 1.5 * motor.inductance * (i_d * di_d + i_q * di_q)
    shaft = motor_torque(i_q, motor, P) * omega
    assert supplied == pytest.approx(copper + field + shaft, rel=1e-12)  # rounding
    printed = 1.5 * P * (motor.inductance * i_d + motor.flux_linkage) * i_q * omega
    assert abs(supplied - copper - field - printed) > 0.01 * abs(shaft)


def test_steady_voltages_solve_the_printed_current_equations():
    """Eq. (1), solved for di/dt as printed."""
    motor, _ = evaluate_motor(TABLE_I_MM * 1e-3, MotorData())
    R, L_d, Phi_m, P = motor.phase_resistance, motor.inductance, motor.flux_linkage, 4
    i_d, i_q, omega, u_d, u_q = 0.7, -2.0, 250.0, 31.0, -44.0
    steady_d, steady_q = steady_voltages(i_d, i_q, omega, motor, P)
    assert (u_d - steady_d) / L_d == pytest.approx(-R / L_d * i_d + P * omega * i_q + u_d / L_d, rel=1e-12)
    assert (u_q - steady_q) / L_d == pytest.approx(
        -R / L_d * i_q - P * omega * (i_d + Phi_m / L_d) + u_q / L_d, rel=1e-12
    )


def winding_from_conductors(slots: int, pole_pairs: int) -> tuple[float, bool]:
    """Winding factor and symmetry of a double-layer tooth-coil winding, from the EMF phasors of its conductors.

    A conductor in slot s sees the fundamental at the electrical angle 2 pi P s / Q; a coil is the difference of two
    neighbours. Coils go to the six 60-degree belts A, -C, B, -A, C, -B by the angle of their EMF; where the belts
    begin is tried out. Nothing of k_p or k_d enters.
    """
    conductors = np.exp(2j * np.pi * pole_pairs * np.arange(slots + 1) / slots)
    coils = conductors[:-1] - conductors[1:]
    if np.abs(coils).max() < PHASOR:  # every conductor sees the same: the coils link nothing
        return 0.0, False
    best, symmetric = 0.0, False
    for begin in np.linspace(0, np.pi / 3, 24, endpoint=False) + 1e-4:
        belt = np.floor((np.angle(coils) - begin) % (2 * np.pi) / (np.pi / 3)).astype(int)
        phase, sign = np.array([0, 2, 1, 0, 2, 1])[belt], np.array([1, -1, 1, -1, 1, -1])[belt]
        emf = np.array([np.sum(sign[phase == k] * coils[phase == k]) for k in range(3)])
        turn = np.exp(2j * np.pi / 3)
        balanced = np.allclose(emf, emf[0] * turn ** np.arange(3), atol=1e-9) and np.abs(emf[0]) > PHASOR
        if balanced and (np.bincount(phase, minlength=3) == slots // 3).all():
            symmetric = True
            best = max(best, np.abs(emf[0]) / (2 * slots / 3))
    return best, symmetric


PAIRS = [(Q, P) for Q in range(3, 49, 3) for P in range(1, 30)]


def test_winding_factor_of_every_pair_equals_the_conductors():
    wrong, refused = [], 0
    for Q, P in PAIRS:
        expected, symmetric = winding_from_conductors(Q, P)
        try:
            factor = MotorData(slots=Q, pole_pairs=P).winding_factor
        except MotorDataError:
            factor = None
            refused += 1
        if (factor is not None) != symmetric or (symmetric and abs(factor - expected) > PHASOR):
            wrong.append((Q, P, factor, expected, symmetric))
    assert wrong == []
    assert 0 < refused < len(PAIRS) / 2


@pytest.mark.parametrize(
    ("slots", "poles", "tabulated"),
    [
        # Fundamental winding factors of double-layer concentrated windings: F. Libert and J. Soulard, "Investigation
        # on pole-slot combinations for permanent-magnet machines with concentrated windings", ICEM 2004.
        (6, 4, 0.866),
        (6, 8, 0.866),
        (9, 6, 0.866),
        (9, 8, 0.945),
        (9, 10, 0.945),
        (9, 12, 0.866),
        (12, 8, 0.866),
        (12, 10, 0.933),
        (12, 14, 0.933),
        (15, 14, 0.951),
        (18, 14, 0.902),
        (18, 16, 0.945),
        (21, 20, 0.953),
        (24, 22, 0.949),
    ],
)
def test_winding_factor_equals_tables(slots, poles, tabulated):
    data = MotorData(slots=slots, pole_pairs=poles // 2)
    assert data.winding_factor == pytest.approx(tabulated, abs=TABULATED)


def test_flux_of_one_turn_by_integration():
    """Per turn, the first harmonic over one tooth; the paper's own 12/8 keeps its printed flux, 1.047 times that."""
    for Q, P, printed in ((12, 7, False), (9, 4, False), (12, 4, True)):
        data = MotorData(slots=Q, pole_pairs=P)
        motor, _ = evaluate_motor(TABLE_I_MM * 1e-3, data)
        L, R_ro, _, h_m, _, _, b_0 = TABLE_I_MM * 1e-3
        opening = b_0 / data.air_gap
        pitch = 2 * math.pi * R_ro / Q
        k_C = pitch / (pitch - opening**2 / (5 + opening) * data.air_gap)
        magnet = h_m / data.recoil_permeability
        B_g1 = 4 / math.pi * data.remanent_flux_density * magnet / (magnet + data.air_gap * k_C)
        arc = np.linspace(-math.pi / Q, math.pi / Q, 20001)
        through_tooth = np.trapezoid(B_g1 * np.cos(P * arc), arc) * R_ro * L
        ratio = motor.tooth_flux / (through_tooth * data.distribution_factor)
        # 1e-8: trapezoidal error of 20,000 steps.
        assert ratio == pytest.approx(math.pi * P / Q if printed else 1.0, rel=1e-8)


@pytest.mark.parametrize(
    ("wire", "field", "value", "limit"),
    [
        ({"slots": 10}, "slots", 10, "multiple of phases = 3"),
        ({"pole_pairs": 6}, "slots", 12, "must be a multiple of 3"),
        ({"slots": 12.5}, "slots", 12.5, "whole"),
        ({"slots": "12"}, "slots", "12", "number"),
        ({"pole_pairs": 0}, "pole_pairs", 0, "above 0"),
        ({"pole_pairs": True}, "pole_pairs", True, "number"),
        ({"phases": 6}, "phases", 6, "3"),
        ({"parallel_coils": 3}, "parallel_coils", 3, "4 coils"),
        ({"air_gap_mm": -0.5}, "air_gap_mm", pytest.approx(-0.5), "above 0"),
        ({"voltage_limit_V": math.inf}, "voltage_limit_V", math.inf, "finite"),
        ({"magnet_arc_rad": 4.0}, "magnet_arc_rad", 4.0, "pi"),
        ({"filling_factor": 1.1}, "filling_factor", 1.1, "at most 1"),
        ({"bounds_mm": {"L": [30, 20]}}, "bounds_mm.L", pytest.approx([30, 20]), "lower one first"),
        ({"bounds_mm": {"L": [20]}}, "bounds_mm.L", [20], "[lower, upper]"),
        ({"bounds_mm": {"R": [20, 30]}}, "bounds_mm.R", "", "R_ro"),
        ({"air_gap": 0.5}, "air_gap", 0.5, "air_gap_mm"),
    ],
)
def test_refusals_name_field_value_and_limit(wire, field, value, limit):
    with pytest.raises(MotorDataError) as refusal:
        MotorData.from_wire(wire)
    assert refusal.value.field == field
    assert refusal.value.value == value
    assert limit in refusal.value.limit
    assert f"motor.{field}" in str(refusal.value)


def test_not_a_number_is_refused():
    with pytest.raises(MotorDataError, match="air_gap_mm"):
        MotorData.from_wire({"air_gap_mm": math.nan})


def test_wire_form_carries_units():
    data = MotorData.from_wire(
        {
            "air_gap_mm": 0.7,
            "tooth_tip_height_mm": 3,
            "wire_diameter_min_mm": 0.5,
            "slot_height_min_mm": 0.2,
            "slots": 9.0,
            "current_limit_A": 5,
            "bounds_mm": {"h_m": [2, 4]},
        }
    )
    assert [data.air_gap, data.tooth_tip_height, data.wire_diameter_min, data.slot_height_min] == pytest.approx(
        [0.7e-3, 3e-3, 0.5e-3, 0.2e-3]
    )
    assert (data.slots, data.current_limit) == (9, 5)
    assert (data.lower[3], data.upper[3]) == pytest.approx((2e-3, 4e-3))
    assert data.lower[[0, 1, 2, 4, 5, 6]] == pytest.approx(MotorData().lower[[0, 1, 2, 4, 5, 6]])
    assert MotorData.from_wire({}) == MotorData()


def test_default_data_are_the_papers():
    data = MotorData()
    assert data.lower * 1e3 == pytest.approx([20, 10, 10, 1, 5, 5, 1])  # (2a)
    assert data.upper * 1e3 == pytest.approx([100, 100, 100, 5, 10, 20, 10])
    assert (data.current_limit, data.voltage_limit, data.flux_density_limit) == (3, 100, 1.5)  # (3)
    assert data.winding_factor == pytest.approx(0.866, abs=TABULATED)
    assert len(data.coefficients()) == len(COEFFICIENTS)


def test_gradients_against_central_differences():
    """Every parameter and constraint in every dimension; 1e-6 is what steps of 1e-6 leave in double precision."""
    x, c = ca.SX.sym("x", len(DIMENSIONS)), ca.SX.sym("c", len(COEFFICIENTS))
    outputs = ca.vertcat(*motor_parameters(x, c), design_constraints(x, c))
    values = ca.Function("values", [x, c], [outputs])
    jacobian = ca.Function("jacobian", [x, c], [ca.jacobian(outputs, x)])
    coefficients = MotorData().coefficients()
    point = np.array([60, 14, 36, 3, 5.5, 6, 2]) * 1e-3
    exact = jacobian(point, coefficients).full() * point
    scale = np.maximum(np.abs(values(point, coefficients).full()), 1e-300)
    for k, length in enumerate(point):
        step = np.zeros(7)
        step[k] = 1e-6 * length
        ahead, behind = (values(point + s, coefficients).full().ravel() for s in (step, -step))
        difference = (ahead - behind) / 2e-6
        assert (np.abs(difference - exact[:, k]) / scale.ravel()).max() < 1e-6
