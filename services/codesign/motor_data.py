"""What a motor is made of and what limits it: constants, bounds and limits as data.

SI inside. Every field has the default of the paper (Section II-A, limits (2a)-(3c)); see docs/model.md for
the places where the printed text and Table I disagree.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

MU_0 = 4e-7 * math.pi
"""Permeability of vacuum [H/m]."""

DIMENSIONS = ("L", "R_ro", "R_so", "h_m", "h_sy", "w_tooth", "b_0")
"""A motor's seven lengths, in the order of every design vector in the project."""

CONSTRAINTS = (
    "tooth_width_rad",
    "slot_height_mm",
    "mass_kg",
    "wire_diameter_squared_mm2",
    "tooth_flux_density_T",
    "yoke_flux_density_T",
)
"""Names of the design constraints (2b)-(2e) and (3c), in the order of `motor.design_constraints`."""

PAPER_SLOTS_AND_POLE_PAIRS = (12, 4)

_MM = 1e-3


class MotorDataError(ValueError):
    """A motor constant has no meaning; `field`, `value` and `limit` say which and why, as on the wire."""

    def __init__(self, field_name: str, value: object, limit: str) -> None:
        super().__init__(f"motor.{field_name} = {value}: {limit}")
        self.field = field_name
        self.value = value
        self.limit = limit


def _default_bounds() -> dict[str, tuple[float, float]]:
    """Bounds (2a) [m]."""
    millimetres = {
        "L": (20, 100),
        "R_ro": (10, 100),
        "R_so": (10, 100),
        "h_m": (1, 5),
        "h_sy": (5, 10),
        "w_tooth": (5, 20),
        "b_0": (1, 10),
    }
    return {name: (low * _MM, high * _MM) for name, (low, high) in millimetres.items()}


@dataclass(frozen=True)
class MotorData:
    """Constants, bounds and limits of a surface permanent-magnet motor (Section II-A)."""

    pole_pairs: int = 4
    slots: int = 12
    phases: int = 3
    turns_per_tooth: float = 50.0  # Departure 1 (docs/model.md): Table I has 30
    parallel_coils: int = 1
    tooth_tip_height: float = 2e-3
    air_gap: float = 0.5e-3
    magnet_arc: float = math.pi
    remanent_flux_density: float = 1.38
    recoil_permeability: float = 1.05
    filling_factor: float = 0.55
    flux_density_limit: float = 1.5
    wire_diameter_min: float = 0.6e-3
    mass_limit: float = 3.0
    slot_height_min: float = 0.1e-3  # Departure 6 (docs/model.md): (2c) as a closed set
    iron_density: float = 7650.0
    copper_density: float = 8960.0
    copper_resistivity: float = 1.8e-8
    current_limit: float = 3.0
    voltage_limit: float = 100.0
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=_default_bounds)

    def __post_init__(self) -> None:
        for wire, (name, unit) in _WIRE.items():
            value = getattr(self, name)
            if not 0 < value < math.inf:
                raise MotorDataError(wire, value / unit if unit != 1 else value, "must be finite and above 0")
            if name in _WHOLE and not isinstance(value, int):
                raise MotorDataError(wire, value, "must be a whole number")
        if self.magnet_arc > math.pi:
            raise MotorDataError("magnet_arc_rad", self.magnet_arc, "at most pi, the whole pole")
        if self.filling_factor > 1:
            raise MotorDataError("filling_factor", self.filling_factor, "at most 1, a slot of solid copper")
        self._check_winding()
        self._check_bounds()

    def _check_winding(self) -> None:
        if self.phases != 3:
            raise MotorDataError("phases", self.phases, "must be 3, for which the dq equations hold")
        if self.slots % self.phases:
            raise MotorDataError("slots", self.slots, f"must be a multiple of phases = {self.phases}")
        balanced = self.slots // math.gcd(self.slots, self.pole_pairs)
        if balanced % self.phases:
            raise MotorDataError(
                "slots",
                self.slots,
                f"with {self.pole_pairs} pole pairs no balanced {self.phases}-phase winding exists: "
                f"slots / gcd(slots, pole_pairs) = {balanced} must be a multiple of {self.phases}",
            )
        if self.slots_per_phase % self.parallel_coils:
            raise MotorDataError(
                "parallel_coils",
                self.parallel_coils,
                f"must divide the {self.slots_per_phase} coils of a phase",
            )

    def _check_bounds(self) -> None:
        if unknown := set(self.bounds) - set(DIMENSIONS):
            raise MotorDataError(f"bounds_mm.{min(unknown)}", "", f"unknown; known are {', '.join(DIMENSIONS)}")
        for name in DIMENSIONS:
            low, high = self.bounds[name]
            if not 0 < low <= high < math.inf:
                limits = [low / _MM, high / _MM]
                raise MotorDataError(f"bounds_mm.{name}", limits, "must be finite, above 0, the lower one first")

    def __hash__(self) -> int:
        """By value, `bounds` included, so that what depends on the motor data alone can be kept."""
        names = (field.name for field in fields(self) if field.name != "bounds")
        return hash((*(getattr(self, name) for name in names), *sorted(self.bounds.items())))

    @property
    def slots_per_phase(self) -> int:
        """q_1 = Q / m."""
        return self.slots // self.phases

    @property
    def pitch_factor(self) -> float:
        """k_p = sin(pi P / Q)  (appendix, Flux)."""
        return abs(math.sin(math.pi * self.pole_pairs / self.slots))

    @property
    def distribution_factor(self) -> float:
        """k_d of a concentrated winding with belts of 60 degrees  (appendix, Flux).

        The printed gcd(q_1, 2P) counts the coils of a belt that point the same way for every balanced winding.
        """
        q_pm = self.slots_per_phase // math.gcd(self.slots_per_phase, 2 * self.pole_pairs)
        return math.sin(math.pi / 6) / (q_pm * math.sin(math.pi / (6 * q_pm)))

    @property
    def winding_factor(self) -> float:
        """k_w = k_p k_d, without skew."""
        return self.pitch_factor * self.distribution_factor

    @property
    def flux_arc(self) -> float:
        """Angle [rad] over which the first harmonic's peak B_g1 links one turn.

        The paper's motor (12 slots, 4 pole pairs) uses its printed 2 pi / Q, which Table I confirms. For every
        other pair the printed form overstates the flux by pi P / Q, so the exact 2 / P is used: departure 10
        (docs/model.md).
        """
        if (self.slots, self.pole_pairs) == PAPER_SLOTS_AND_POLE_PAIRS:
            return 2 * math.pi / self.slots
        return 2 / self.pole_pairs

    @property
    def lower(self) -> np.ndarray:
        """Lower bounds (2a), shape (7,), m."""
        return np.array([self.bounds[name][0] for name in DIMENSIONS])

    @property
    def upper(self) -> np.ndarray:
        """Upper bounds (2a), shape (7,), m."""
        return np.array([self.bounds[name][1] for name in DIMENSIONS])

    def coefficients(self) -> np.ndarray:
        """The numbers that the motor model reads, in the order of `COEFFICIENTS`."""
        return np.array([float(getattr(self, name)) for name in COEFFICIENTS])

    def with_bounds(self, bounds: Mapping[str, tuple[float, float]]) -> MotorData:
        """A copy with some bounds [m] replaced."""
        return replace(self, bounds={**self.bounds, **bounds})

    def to_wire(self) -> dict[str, Any]:
        """Every constant, limit and bound in the form that `from_wire` reads."""
        constants = {key: getattr(self, name) / unit for key, (name, unit) in _WIRE.items()}
        return {**constants, "bounds_mm": {name: [end / _MM for end in ends] for name, ends in self.bounds.items()}}

    @classmethod
    def from_wire(cls, wire: Mapping[str, Any]) -> MotorData:
        """Read the wire form (units in the names, lengths in mm); missing fields keep their defaults.

        Raises
        ------
        MotorDataError
            For an unknown field or constants without a meaning.
        """
        values: dict[str, Any] = {}
        for key, value in wire.items():
            if key == "bounds_mm":
                bounds = {name: _bounds_from_wire(name, pair) for name, pair in value.items()}
                values["bounds"] = {**_default_bounds(), **bounds}
            elif key in _WIRE:
                name, unit = _WIRE[key]
                number = _number(key, value)
                values[name] = int(number) if name in _WHOLE and number % 1 == 0 else number * unit
            else:
                raise MotorDataError(key, value, f"unknown; known are {', '.join(sorted(_WIRE))}, bounds_mm")
        return cls(**values)


def _number(key: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise MotorDataError(key, value, "must be a number")
    return value


def _bounds_from_wire(name: str, pair: Any) -> tuple[float, float]:
    if not isinstance(pair, Sequence) or len(pair) != 2:
        raise MotorDataError(f"bounds_mm.{name}", pair, "must be [lower, upper] in mm")
    low, high = (_number(f"bounds_mm.{name}", value) * _MM for value in pair)
    return low, high


COEFFICIENTS = (
    "pole_pairs",
    "slots",
    "slots_per_phase",
    "turns_per_tooth",
    "parallel_coils",
    "tooth_tip_height",
    "air_gap",
    "magnet_arc",
    "remanent_flux_density",
    "recoil_permeability",
    "filling_factor",
    "pitch_factor",
    "winding_factor",
    "flux_arc",
    "iron_density",
    "copper_density",
    "copper_resistivity",
)
"""What `MotorData.coefficients` lists: the constants that enter the motor model as parameters."""

_WIRE: dict[str, tuple[str, float]] = {
    "pole_pairs": ("pole_pairs", 1),
    "slots": ("slots", 1),
    "phases": ("phases", 1),
    "turns_per_tooth": ("turns_per_tooth", 1),
    "parallel_coils": ("parallel_coils", 1),
    "tooth_tip_height_mm": ("tooth_tip_height", _MM),
    "air_gap_mm": ("air_gap", _MM),
    "magnet_arc_rad": ("magnet_arc", 1),
    "remanent_flux_density_T": ("remanent_flux_density", 1),
    "recoil_permeability": ("recoil_permeability", 1),
    "filling_factor": ("filling_factor", 1),
    "flux_density_limit_T": ("flux_density_limit", 1),
    "wire_diameter_min_mm": ("wire_diameter_min", _MM),
    "mass_limit_kg": ("mass_limit", 1),
    "slot_height_min_mm": ("slot_height_min", _MM),
    "iron_density_kg_m3": ("iron_density", 1),
    "copper_density_kg_m3": ("copper_density", 1),
    "copper_resistivity_ohm_m": ("copper_resistivity", 1),
    "current_limit_A": ("current_limit", 1),
    "voltage_limit_V": ("voltage_limit", 1),
}
"""Name on the wire -> (field, SI value of one of its units)."""

_WHOLE = ("pole_pairs", "slots", "phases", "parallel_coils")
