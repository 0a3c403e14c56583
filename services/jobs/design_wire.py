"""Designs as they are stored and sent: lengths in mm, and the sheet of each motor."""

from __future__ import annotations

from typing import Any

import numpy as np

from services.codesign.design_sheet import design_sheet
from services.codesign.motor_data import MotorData

MILLIMETRE = 1e-3


def design_wire(design: np.ndarray, motor: MotorData, gear_ratio: np.ndarray | None = None) -> dict[str, Any]:
    """Shape (n, 7) in m -> ``{design_mm, motors}``; with gear ratios that were free, shape (n,), those as well."""
    return {"design_mm": design_mm(design)} | gears_wire(gear_ratio) | design_sheet(design, motor, gear_ratio)


def gears_wire(gear_ratio: np.ndarray | None) -> dict[str, list[float]]:
    """``{gear_ratio}`` of a design, shape (n,), where the ratios were free."""
    return {} if gear_ratio is None else {"gear_ratio": gear_ratio.tolist()}


def design_mm(design: np.ndarray) -> list[list[float]]:
    """Shape (n, 7) in m -> nested lists in mm."""
    values: list[list[float]] = (design / MILLIMETRE).tolist()
    return values


def design_array(design_mm: list[list[float]]) -> np.ndarray:
    """Inverse of `design_mm`."""
    return np.array(design_mm) * MILLIMETRE
