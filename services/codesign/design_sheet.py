"""A design as people read it: millimetres, derived parameters, how far each limit is and which ones bind.

The wire form of a `design`: every name carries its unit.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from services.codesign.motor import MotorParameters, constraint_limits, evaluate_motor, motor_torque
from services.codesign.motor_data import CONSTRAINTS, DIMENSIONS, MotorData

BINDING_TOLERANCE = 1e-3
"""A limit binds when its slack is below this share of it: an interior-point solution stays a little inside."""

_MM = 1e3  # mm per m

_CONSTRAINT_UNITS = {
    "tooth_width": "rad",
    "slot_height": "mm",
    "mass": "kg",
    "wire_diameter": "mm",
    "tooth_flux_density": "T",
    "yoke_flux_density": "T",
}
"""Names for people of `CONSTRAINTS`, in the same order, with their units."""


def design_sheet(design: np.ndarray, motor: MotorData, gear_ratio: np.ndarray | None = None) -> dict[str, Any]:
    """The wire form of a design, shape (n, 7) [m]: ``{"motors": [...]}``; with free gears their ratios, shape (n,)."""
    sheets = [motor_sheet(k, row, motor) for k, row in enumerate(design)]
    if gear_ratio is not None:
        sheets = [sheet | {"gear_ratio": float(ratio)} for sheet, ratio in zip(sheets, gear_ratio, strict=True)]
    return {"motors": sheets}


def motor_sheet(joint: int, design: np.ndarray, motor: MotorData) -> dict[str, Any]:
    """One motor, design of shape (7,) [m], of joint 0..n-1 (shown from 1)."""
    parameters, values = evaluate_motor(design, motor)
    limits = {**_bound_limits(design, motor), **_constraint_limits(values, motor)}
    return {
        "joint": joint + 1,
        "dimensions_mm": {name: float(length) * _MM for name, length in zip(DIMENSIONS, design, strict=True)},
        "parameters": _parameters(parameters, motor),
        "constraints": limits,
        "binding": [name for name, entry in limits.items() if _binds(entry)],
    }


def _parameters(p: MotorParameters, motor: MotorData) -> dict[str, float]:
    return {
        "flux_linkage_Wb": p.flux_linkage,
        "inductance_H": p.inductance,
        "phase_resistance_ohm": p.phase_resistance,
        "torque_constant_Nm_per_A": motor_torque(1.0, p, motor.pole_pairs),
        "torque_limit_Nm": motor_torque(motor.current_limit, p, motor.pole_pairs),
        "stator_mass_kg": p.stator_mass,
        "rotor_mass_kg": p.rotor_mass,
        "rotor_inertia_axial_kg_m2": p.rotor_inertia_axial,
        "rotor_inertia_transverse_kg_m2": p.rotor_inertia_transverse,
        "stator_inertia_axial_kg_m2": p.stator_inertia_axial,
        "stator_inertia_transverse_kg_m2": p.stator_inertia_transverse,
        "wire_diameter_mm": 2 * math.sqrt(p.coil_area / math.pi) * _MM if p.coil_area > 0 else 0.0,
    }


def _bound_limits(design: np.ndarray, motor: MotorData) -> dict[str, dict[str, Any]]:
    """Bounds (2a)."""
    limits = {}
    for name, length, low, high in zip(DIMENSIONS, design * _MM, motor.lower * _MM, motor.upper * _MM, strict=True):
        limits[f"{name}_min"] = _entry(length, low, length - low, "mm")
        limits[f"{name}_max"] = _entry(length, high, high - length, "mm")
    return limits


def _constraint_limits(values: dict[str, float], motor: MotorData) -> dict[str, dict[str, Any]]:
    """(2b)-(2e) and (3c); the wire by its diameter, where the program has the square."""
    limits = {}
    low, high = constraint_limits(motor)
    for k, (name, unit) in enumerate(_CONSTRAINT_UNITS.items()):
        at_least = math.isfinite(low[k])
        value, limit = values[CONSTRAINTS[k]], float(low[k] if at_least else high[k])
        if name == "wire_diameter":
            value, limit = math.copysign(math.sqrt(abs(value)), value), math.sqrt(limit)
        limits[name] = _entry(value, limit, value - limit if at_least else limit - value, unit)
    return limits


def _entry(value: float, limit: float, slack: float, unit: str) -> dict[str, Any]:
    return {"value": float(value), "limit": float(limit), "slack": float(slack), "unit": unit}


def _binds(entry: dict[str, Any]) -> bool:
    return bool(entry["slack"] <= BINDING_TOLERANCE * abs(entry["limit"]))
