"""Robots as data: a serial arm of n revolute joints in the product-of-exponentials form.

All poses and screw axes are at home (all joint angles zero) in the space frame, as in Lynch & Park.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib.resources import files
from typing import Any

import numpy as np

PAYLOAD_RADIUS = 0.05
"""Radius [m] of the payload, a solid ball (MODEL section 3)."""


TOLERANCE = 1e-6
"""How far axes may be from unit length, and poses and inertias from rigid, for figures rounded to six digits."""

_WIRE = {
    "gravity": "gravity_m_s2",
    "screw_axes": "screw_axes_space",
    "link_com_home": "link_com_home",
    "link_mass": "link_mass_kg",
    "link_inertia": "link_inertia_com_kg_m2",
    "motor_position": "motor_position_home_m",
    "tool_home": "tool_home",
    "gear_ratio": "gear_ratio",
}
"""Fields of `Robot` that are arrays of the robot JSON, with their names there."""

_WIRE_DEFAULTS = {
    "viscous_friction": ("viscous_friction_Nms_rad", 0.0),
    "coulomb_friction": ("coulomb_friction_Nm", 0.0),
    "joint_speed_bound": ("joint_speed_limit_rad_s", np.inf),
}
"""Fields with one number a joint that may be left out, as a whole or (null) for a joint: names there, and defaults."""

LARGEST = 1e9
"""Of any number in a robot: far beyond any arm, and safe to multiply."""

_WIRE_LIMITS, _WIRE_SPEED = "joint_position_limit_rad", "rotor_speed_limit_rad_s"
_WIRE_TEXTS = ("name", "description", "source")


class RobotError(ValueError):
    """A robot file does not describe an arm; the message begins with the field's name in the file, `field`."""

    def __init__(self, field: str, reason: str) -> None:
        super().__init__(f"{field}: {reason}")
        self.field = field
        self.reason = reason


@dataclass(frozen=True, eq=False)  # arrays have no one truth
class Robot:
    """A serial arm with n joints; arrays are read-only, units SI."""

    name: str
    gravity: np.ndarray  # (3,) m/s2, space frame
    screw_axes: np.ndarray  # (n, 6) (omega, v), space frame
    link_com_home: np.ndarray  # (n, 4, 4) pose of each link's centre of mass
    link_mass: np.ndarray  # (n,) kg
    link_inertia: np.ndarray  # (n, 3, 3) kg m2 about the centre of mass, axes of `link_com_home`
    motor_position: np.ndarray  # (n, 3) m, space frame
    tool_home: np.ndarray  # (4, 4)
    gear_ratio: np.ndarray  # (n,) rotor turns per joint turn, relative to the previous link; < 0 where it reverses
    joint_lower: np.ndarray  # (n,) rad
    joint_upper: np.ndarray  # (n,) rad
    rotor_speed_limit: float  # rad/s
    viscous_friction: np.ndarray = field(default_factory=lambda: np.empty(0))  # (n,) N m s/rad at the joint; default 0
    coulomb_friction: np.ndarray = field(default_factory=lambda: np.empty(0))  # (n,) N m at the joint; default 0
    joint_speed_bound: np.ndarray = field(default_factory=lambda: np.empty(0))  # (n,) rad/s; default infinite

    def __post_init__(self) -> None:
        for name, (_, default) in _WIRE_DEFAULTS.items():
            if getattr(self, name).size == 0:
                object.__setattr__(self, name, _read_only(np.full(self.gear_ratio.size, default)))
        self._check_shapes()
        self._check_geometry()
        self._check_bodies()
        if not (self.gear_ratio != 0).all():
            raise RobotError("gear_ratio", f"{self.gear_ratio.tolist()}: must not be 0")
        if not (self.joint_lower < self.joint_upper).all():
            limits = np.column_stack([self.joint_lower, self.joint_upper]).tolist()
            raise RobotError(_WIRE_LIMITS, f"{limits}: each lower limit must lie below its upper one")
        if not 0 < self.rotor_speed_limit < np.inf:
            raise RobotError(_WIRE_SPEED, f"{self.rotor_speed_limit}: must be finite and above 0")
        for name in ("viscous_friction", "coulomb_friction"):
            if not (getattr(self, name) >= 0).all():
                wire, _ = _WIRE_DEFAULTS[name]
                raise RobotError(wire, f"{getattr(self, name).tolist()}: must not be negative")
        if not (self.joint_speed_bound > 0).all():
            raise RobotError("joint_speed_limit_rad_s", f"{self.joint_speed_bound.tolist()}: must be above 0")

    def _check_shapes(self) -> None:
        n = self.joints
        shapes: dict[str, tuple[int, ...]] = {
            "gear_ratio": (n,),
            "gravity": (3,),
            "screw_axes": (n, 6),
            "link_com_home": (n, 4, 4),
            "link_mass": (n,),
            "link_inertia": (n, 3, 3),
            "motor_position": (n, 3),
            "tool_home": (4, 4),
            "joint_lower": (n,),
            "joint_upper": (n,),
        }
        for name, shape in shapes.items():
            array, wire = getattr(self, name), _WIRE.get(name, _WIRE_LIMITS)
            if array.shape != shape:
                raise RobotError(wire, f"shape {array.shape}, but {n} joints need {shape}")
            if not (np.abs(array) <= LARGEST).all():
                raise RobotError(wire, f"every entry must be a finite number, at most {LARGEST:g} in size")
        for name, (wire, _) in _WIRE_DEFAULTS.items():
            array = getattr(self, name)
            if array.shape != (n,):
                raise RobotError(wire, f"shape {array.shape}, but {n} joints need {(n,)}")
            if not (np.isposinf(array) | (np.abs(array) <= LARGEST)).all():
                raise RobotError(wire, f"every entry must be a number, at most {LARGEST:g} in size")

    def _check_geometry(self) -> None:
        axes, moments = self.screw_axes[:, :3], self.screw_axes[:, 3:]
        norms = np.linalg.norm(axes, axis=1)
        if not np.allclose(norms, 1, atol=TOLERANCE):
            raise RobotError("screw_axes_space", f"axes must be unit vectors, their lengths are {norms.tolist()}")
        pitch = np.sum(axes * moments, axis=1)
        if not np.allclose(pitch, 0, atol=TOLERANCE):
            raise RobotError("screw_axes_space", f"joints must be revolute, the pitches are {pitch.tolist()} m/rad")
        for name in ("link_com_home", "tool_home"):
            for pose in getattr(self, name).reshape(-1, 4, 4):
                R = pose[:3, :3]
                proper = np.allclose(R @ R.T, np.eye(3), atol=TOLERANCE) and np.linalg.det(R) > 0
                if not proper or not np.array_equal(pose[3], [0, 0, 0, 1]):
                    raise RobotError(name, f"{pose.tolist()}: not the pose of a rigid body")

    def _check_bodies(self) -> None:
        if not (self.link_mass >= 0).all():
            raise RobotError("link_mass_kg", f"{self.link_mass.tolist()}: must not be negative")
        for inertia in self.link_inertia:
            size = TOLERANCE * np.abs(inertia).max()
            if not np.allclose(inertia, inertia.T, atol=size) or np.linalg.eigvalsh(inertia).min() < -size:
                raise RobotError("link_inertia_com_kg_m2", f"{inertia.tolist()}: must be symmetric and not negative")

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return self.gear_ratio.size

    @property
    def joint_origins(self) -> np.ndarray:
        """A point on each joint axis at home, shape (n, 3): the one nearest to the space origin."""
        return np.cross(self.screw_axes[:, :3], self.screw_axes[:, 3:])

    @property
    def joint_axes(self) -> np.ndarray:
        """Unit joint axes at home, shape (n, 3)."""
        return self.screw_axes[:, :3]

    @property
    def joint_speed_limit(self) -> np.ndarray:
        """|qd| allowed by the rotor speed limit and the gears, and by the joints, shape (n,), rad/s  (eq. 5c)."""
        limit: np.ndarray = np.minimum(self.rotor_speed_limit / np.abs(self.gear_ratio), self.joint_speed_bound)
        return limit

    def with_gears(self, gear_ratio: np.ndarray) -> Robot:
        """The same arm with other gear ratios, shape (n,)."""
        return replace(self, gear_ratio=_read_only(np.array(gear_ratio, dtype=float)))

    @classmethod
    def from_wire(cls, wire: Mapping[str, Any]) -> Robot:
        """Read the robot JSON format (`robots/*.json`).

        Raises
        ------
        RobotError
            When a field is missing or unknown, or says something that no arm can be.
        """
        needed = ("name", *_WIRE.values(), _WIRE_LIMITS, _WIRE_SPEED)
        if missing := [key for key in needed if key not in wire]:
            raise RobotError(missing[0], "missing")
        optional = [*_WIRE_TEXTS[1:], *(key for key, _ in _WIRE_DEFAULTS.values())]
        if unknown := set(wire) - set(needed) - set(optional):
            raise RobotError(min(unknown), f"unknown; known are {', '.join([*needed, *optional])}")
        limits = _array(wire, _WIRE_LIMITS)
        if limits.ndim != 2 or limits.shape[1] != 2:
            raise RobotError(_WIRE_LIMITS, f"shape {limits.shape}, but each joint needs a lower and an upper limit")
        return cls(
            name=str(wire["name"]),
            joint_lower=limits[:, 0],
            joint_upper=limits[:, 1],
            rotor_speed_limit=float(_array(wire, _WIRE_SPEED, dimensions=0)),
            **{name: _array(wire, key) for name, key in _WIRE.items()},
            **{
                name: _array({key: _filled(wire[key], default)}, key)
                for name, (key, default) in _WIRE_DEFAULTS.items()
                if wire.get(key) is not None
            },
        )

    @classmethod
    def preset(cls, name: str) -> Robot:
        """One of the robots that come with the package."""
        return cls.from_wire(preset_wire(name))


def _array(wire: Mapping[str, Any], key: str, dimensions: int | None = None) -> np.ndarray:
    """The numbers of a field, read-only."""
    try:
        array = np.array(wire[key], dtype=float)
    except (TypeError, ValueError, OverflowError) as not_numbers:
        raise RobotError(key, "must be numbers, in rows of equal length") from not_numbers
    if dimensions is not None and array.ndim != dimensions:
        raise RobotError(key, f"{wire[key]}: must have {dimensions} dimensions")
    if array.size == 0:
        raise RobotError(key, "must not be empty")
    return _read_only(array)


def _filled(values: Any, default: float) -> Any:
    """A list with its nulls replaced."""
    return [default if value is None else value for value in values] if isinstance(values, list) else values


def _read_only(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array


def preset_names() -> list[str]:
    """Names of the robots in the package, sorted."""
    folder = files("services.codesign") / "robots"
    return sorted(entry.name.removesuffix(".json") for entry in folder.iterdir() if entry.name.endswith(".json"))


def preset_wire(name: str) -> dict[str, Any]:
    """The JSON of a preset.

    Raises
    ------
    RobotError
        For an unknown name.
    """
    if name not in preset_names():
        raise RobotError("robot", f"unknown robot {name!r}; presets: {', '.join(preset_names())}")
    data: dict[str, Any] = json.loads((files("services.codesign") / "robots" / f"{name}.json").read_text())
    return data
