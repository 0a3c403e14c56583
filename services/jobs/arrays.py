"""A solution's arrays in one compressed column: the motion on its grid, and the solver's point with multipliers."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import fields

import numpy as np

from services.codesign.guess import MotionPoint
from services.codesign.motion import Motion
from services.codesign.solution import Solution
from services.codesign.voltage_law import VoltageLaw

POINT = ("x", "lam_x", "lam_g")
"""The program's variables and multipliers, scaled, beside the fields of `Motion`."""

LAW = "law_"
"""Prefix of the fields of `VoltageLaw`."""


def pack(solution: Solution, law: VoltageLaw) -> bytes:
    """Motion, voltage law, design and solver point of a successful solve as a NumPy archive, exact to the last bit."""
    assert solution.motion is not None
    assert solution.design is not None
    arrays = {field.name: getattr(solution.motion, field.name) for field in fields(Motion)}
    arrays |= {LAW + field.name: getattr(law, field.name) for field in fields(VoltageLaw)}
    arrays |= {name: getattr(solution, name) for name in POINT}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, design=solution.design, **arrays)
    return buffer.getvalue()


def pack_points(points: Mapping[int, MotionPoint]) -> bytes:
    """Where the joint program has the motions of these tasks, exact to the last bit."""
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer, **{f"{task}-{name}": getattr(point, name) for task, point in points.items() for name in POINT}
    )
    return buffer.getvalue()


def unpack_point(blob: bytes, task: int) -> MotionPoint:
    """One of them; the others stay packed."""
    with np.load(io.BytesIO(blob), allow_pickle=False) as archive:
        return MotionPoint(**{name: archive[f"{task}-{name}"] for name in POINT})


def unpack(blob: bytes) -> dict[str, np.ndarray]:
    """Arrays by name."""
    with np.load(io.BytesIO(blob), allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def unpack_motion(blob: bytes) -> tuple[Motion, np.ndarray]:
    """The motion and its design, shape (n, 7) [m]."""
    arrays = unpack(blob)
    return Motion(**{field.name: arrays[field.name] for field in fields(Motion)}), arrays["design"]


def unpack_law(blob: bytes) -> VoltageLaw:
    """The voltages between the points."""
    arrays = unpack(blob)
    return VoltageLaw(**{field.name: arrays[LAW + field.name] for field in fields(VoltageLaw)})
