"""Requests that tests start from."""

from __future__ import annotations

from typing import Any

from shared.contracts.application import ApplicationRequest

POSE = [0.1, -0.2, 0.3, 0.0, 0.1, 0.0]
HOME = [0.0] * 6


def body(**changes: Any) -> dict[str, Any]:
    """A valid application of three tasks on explicit poses, with some fields replaced."""
    return {
        "name": "three moves",
        "tasks": [{"name": f"move {k}", "start_rad": POSE, "end_rad": HOME, "payload_kg": float(k)} for k in range(3)],
        **changes,
    }


def grid(**changes: Any) -> dict[str, Any]:
    """A valid application on a grid of 2 x 2 tasks, with some fields replaced."""
    return {"name": "grid", "tasks": {"grid": {"stroke": [0.2, 0.4], "payload_kg": [0.0, 1.0]}}, **changes}


def application(**changes: Any) -> ApplicationRequest:
    """`body`, validated."""
    return ApplicationRequest(**body(**changes))
