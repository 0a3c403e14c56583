"""Tasks as random samples: a design for all of them is robust over payloads and poses that scatter.

The samples of a task fill its box evenly (a Latin hypercube): each tenth of ten payloads occurs once. They depend on
the seed and the task's place alone, so that another task more changes none of the others.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.stats import norm, qmc

from services.codesign.robot import Robot
from services.jobs.resolved import ResolvedTask
from shared.contracts.application import ScatterRequest

DIGITS = 9
"""Samples are rounded to this many decimals, so that the same seed gives the same tasks on every processor."""


def sample_name(task: str, sample: int) -> str:
    """Name of sample 0, 1, ... of a task."""
    return f"{task}, sample {sample + 1}"


def samples_of(task: ResolvedTask, place: int, scatter: ScatterRequest, robot: Robot) -> Iterator[ResolvedTask]:
    """Samples around a task, which is the `place`-th of the application."""
    n = robot.joints
    offsets = _offsets(scatter, 2 * n + 1, place)
    payloads = np.maximum(task.payload_kg + scatter.payload_kg * offsets[:, 0], 0.0)
    starts, ends = (
        np.clip((np.array(pose) + scatter.position_rad * part).round(DIGITS), robot.joint_lower, robot.joint_upper)
        for pose, part in ((task.start_rad, offsets[:, 1 : n + 1]), (task.end_rad, offsets[:, n + 1 :]))
    )
    for k in range(scatter.samples):
        changes = {
            "name": sample_name(task.name, k),
            "payload_kg": float(payloads[k].round(DIGITS)),
            "start_rad": starts[k].tolist(),
            "end_rad": ends[k].tolist(),
            "weight": task.weight / scatter.samples,
        }
        yield task.model_copy(update=changes)


def _offsets(scatter: ScatterRequest, size: int, place: int) -> np.ndarray:
    """Shape (samples, size): in -1..1, or with standard deviation 1."""
    shares = qmc.LatinHypercube(size, rng=np.random.default_rng([scatter.seed, place])).random(scatter.samples)
    offsets: np.ndarray = norm.ppf(shares) if scatter.distribution == "normal" else 2 * shares - 1
    return offsets
