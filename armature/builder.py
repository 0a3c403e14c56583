"""An application put together in Python, step by step, where a YAML file would be in the way.

from armature import ApplicationBuilder

cell = ApplicationBuilder("cell 3", robot="ur5").minimise("time").compare("empirical", task="lift")
for payload_kg in (0, 1, 2):
    cell = cell.task(f"lift {payload_kg} kg", start_rad=[0.6] * 6, end_rad=[0.0] * 6, payload_kg=payload_kg)
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from armature.application_file import read_robot
from shared.contracts.application import MethodName

SUFFIXES = (".json", ".yaml", ".yml")
"""Of files."""


class ApplicationBuilder:
    """An application's content. Every step gives a new builder and leaves the old one as it was.

    Fields have the names that they have in YAML; the server judges them when the builder is submitted.

    Parameters
    ----------
    name
        Of the application.
    robot
        A preset's name, the id of an upload, a robot's content, or the path of a robot's file (.json, .yaml).
    """

    def __init__(self, name: str, robot: str | Path | Mapping[str, Any] = "ur5") -> None:
        if isinstance(robot, Path) or (isinstance(robot, str) and Path(robot).suffix in SUFFIXES):
            robot = read_robot(robot)
        self._content: dict[str, Any] = {"name": name, "robot": robot}

    def __repr__(self) -> str:
        return f"ApplicationBuilder({self._content['name']!r}: {', '.join(self._content)})"

    def to_dict(self) -> dict[str, Any]:
        """As it would stand in a file."""
        return copy.deepcopy(self._content)

    def minimise(self, kind: str, **fields: Any) -> Self:
        """What is minimised: `time`, `energy`, `electrical_energy`, or `weighted` with `alpha`."""
        return self._with(objective={"kind": kind, **fields})

    def task(
        self,
        name: str,
        *,
        start_rad: Sequence[float],
        end_rad: Sequence[float],
        payload_kg: float = 0.0,
        **fields: Any,
    ) -> Self:
        """One more task: from one joint state to another [rad] with a payload [kg]; also `duration_s`, `weight`, ..."""
        added = {"name": name, "start_rad": _numbers(start_rad), "end_rad": _numbers(end_rad), "payload_kg": payload_kg}
        known = self._content.get("tasks", [])
        return self._with(tasks=[*(known if isinstance(known, list) else []), added | fields])

    def grid(self, stroke: Sequence[float], payload_kg: Sequence[float], duration_s: float | None = None) -> Self:
        """The paper's task set in place of single tasks: from stroke * (1, ..., 1) rad to 0, each payload [kg]."""
        grid: dict[str, Any] = {"stroke": _numbers(stroke), "payload_kg": _numbers(payload_kg)}
        return self._with(tasks={"grid": grid if duration_s is None else grid | {"duration_s": duration_s}})

    def motor(self, **constants: Any) -> Self:
        """Constants, limits and bounds of the motors, such as `current_limit_A`; added to those given before."""
        return self._with(motor=self._content.get("motor", {}) | constants)

    def design(self, **fields: Any) -> Self:
        """Freedom of the design: `gear_ratios={2: [50, 200]}`, `identical=[[1, 2, 3]]`; added to what was given."""
        return self._with(design=self._content.get("design", {}) | fields)

    def transcription(self, **fields: Any) -> Self:
        """How it is solved: `accuracy`, `preset`, or `scheme`, `degree`, `intervals`, `control`."""
        return self._with(transcription=fields)

    def starts(self, count: int) -> Self:
        """Solve each motion from so many starts and keep the best of the optima found."""
        return self._with(starts=count)

    def method(self, name: MethodName) -> Self:
        """How one design is found for all tasks."""
        return self._with(method=name)

    def compare(self, method: MethodName, task: int | str | None = None) -> Self:
        """One more method to compare with; `empirical` and `worst_case` are one task's design, by index or name."""
        chosen = {} if task is None else {f"{method}_task": task}
        return self._with(compare=[*self._content.get("compare", []), method], **chosen)

    def tags(self, *names: str) -> Self:
        """Tags to find it by."""
        return self._with(tags=[*self._content.get("tags", []), *names])

    def _with(self, **fields: Any) -> Self:
        other = copy.copy(self)
        other._content = self._content | fields
        return other


def _numbers(values: Sequence[float]) -> list[float]:
    """Python's numbers, of lists and of arrays alike."""
    return [float(value) for value in values]
