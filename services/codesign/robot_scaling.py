"""An arm of other proportions: the same links longer or shorter, lighter or heavier."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


def scaled_arm(wire: Mapping[str, Any], length: float, masses: Sequence[float]) -> dict[str, Any]:
    """A robot, in the form of its file, with every distance scaled by `length` and link k's mass by ``masses[k]``.

    A link keeps its shape: its inertia about its centre of mass goes with its mass and the square of the lengths. Motor
    positions and tool move along; gears, limits and friction stay.
    """
    mass = np.array(masses, dtype=float)
    axes = np.array(wire["screw_axes_space"], dtype=float)
    axes[:, 3:] *= length
    coms, tool = (np.array(wire[name], dtype=float) for name in ("link_com_home", "tool_home"))
    coms[:, :3, 3] *= length
    tool[:3, 3] *= length
    inertia = np.array(wire["link_inertia_com_kg_m2"], dtype=float) * (mass * length**2)[:, None, None]
    return {
        **wire,
        "screw_axes_space": axes.tolist(),
        "link_com_home": coms.tolist(),
        "tool_home": tool.tolist(),
        "motor_position_home_m": (np.array(wire["motor_position_home_m"], dtype=float) * length).tolist(),
        "link_mass_kg": (np.array(wire["link_mass_kg"], dtype=float) * mass).tolist(),
        "link_inertia_com_kg_m2": inertia.tolist(),
    }
