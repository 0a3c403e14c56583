"""Robots as data: a serial arm of n revolute joints in the product-of-exponentials form.

All poses and screw axes are at home (all joint angles zero) in the space frame, as in Lynch & Park.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np

PAYLOAD_RADIUS = 0.05
"""Radius [m] of the payload, a solid ball (MODEL section 3)."""


class RobotError(ValueError):
    """A robot file does not describe an arm; the message names the field."""


@dataclass(frozen=True)
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
    gear_ratio: np.ndarray  # (n,) rotor turns per joint turn, relative to the previous link
    joint_lower: np.ndarray  # (n,) rad
    joint_upper: np.ndarray  # (n,) rad
    rotor_speed_limit: float  # rad/s

    def __post_init__(self) -> None:
        n = self.joints
        shapes = {
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
            if getattr(self, name).shape != shape:
                raise RobotError(f"{name}: shape {getattr(self, name).shape}, but {n} joints need {shape}")
        norms = np.linalg.norm(self.screw_axes[:, :3], axis=1)
        if not np.allclose(norms, 1, atol=1e-9):
            raise RobotError(f"screw_axes: rotation parts must be unit vectors, their lengths are {norms.tolist()}")

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return len(self.gear_ratio)

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
        """|qd| allowed by the rotor speed limit and the gears, shape (n,), rad/s  (eq. 5c)."""
        return self.rotor_speed_limit / self.gear_ratio

    @classmethod
    def from_wire(cls, wire: Mapping[str, Any]) -> Robot:
        """Read the robot JSON format (`robots/*.json`).

        Raises
        ------
        RobotError
            When a field is missing or its shape does not fit the number of joints.
        """
        try:
            limits = _array(wire["joint_position_limit_rad"])
            return cls(
                name=str(wire["name"]),
                gravity=_array(wire["gravity_m_s2"]),
                screw_axes=_array(wire["screw_axes_space"]),
                link_com_home=_array(wire["link_com_home"]),
                link_mass=_array(wire["link_mass_kg"]),
                link_inertia=_array(wire["link_inertia_com_kg_m2"]),
                motor_position=_array(wire["motor_position_home_m"]),
                tool_home=_array(wire["tool_home"]),
                gear_ratio=_array(wire["gear_ratio"]),
                joint_lower=limits[:, 0],
                joint_upper=limits[:, 1],
                rotor_speed_limit=float(wire["rotor_speed_limit_rad_s"]),
            )
        except KeyError as missing:
            raise RobotError(f"the robot lacks the field {missing}") from missing

    @classmethod
    def preset(cls, name: str) -> Robot:
        """One of the robots that come with the package."""
        return cls.from_wire(preset_wire(name))


def _array(values: Any) -> np.ndarray:
    array = np.array(values, dtype=float)
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
        raise RobotError(f"unknown robot {name!r}; presets: {', '.join(preset_names())}")
    data: dict[str, Any] = json.loads((files("services.codesign") / "robots" / f"{name}.json").read_text())
    return data
