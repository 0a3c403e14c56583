"""Designs as one table: a row a motor, of each task's own design, the mean, and each method's design."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from shared.contracts.comparisons import DesignsAnswer


def design_columns(designs: DesignsAnswer) -> dict[str, list[Any]]:
    """Columns `design` (own, mean, a method), `task` (a name; empty for shared ones), `joint` from 1, `L_mm`, ..."""
    names = ["design", "task", "joint", *(_with_unit(name) for name in designs.dimensions)]
    rows = list(_rows(designs))
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def _rows(designs: DesignsAnswer) -> Iterator[list[Any]]:
    for own in designs.tasks:
        yield from _motors("own", own.name, own.design_mm)
    shared = {} if designs.mean is None else {"mean": designs.mean}
    for name, design in (shared | designs.methods).items():
        yield from _motors(name, "", design.design_mm)


def _motors(design: str, task: str, motors_mm: list[list[float]]) -> Iterator[list[Any]]:
    for joint, dimensions in enumerate(motors_mm, start=1):
        yield [design, task, joint, *dimensions]


def _with_unit(dimension: str) -> str:
    return dimension if dimension.endswith("_mm") else f"{dimension}_mm"
