"""One solve with a known answer: ``python -m armature.doctor.trial KERNELS`` prints what came out as a line of JSON."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

EXPECTED_S, TOLERANCE_S = 0.313153, 1e-4
"""Minimum time of the UR5 over 0.6 rad at every joint with 2 kg, with motors of its own, in the transcription that
applications start from; the same to six digits with both linear solvers and with kernels not compiled."""


def trial(cache: Path) -> dict[str, Any]:
    """Load the kernels, then solve."""
    import numpy as np

    from services.codesign.kernels import load_kernels
    from services.codesign.motor_data import MotorData
    from services.codesign.problem import FIRST, Objective, Problem, Task
    from services.codesign.robot import Robot
    from services.codesign.solve import solve

    task = Task(start=np.full(6, 0.6), end=np.zeros(6), payload=2.0)
    problem = Problem(Robot.preset("ur5"), task, MotorData(), Objective("time"), FIRST)
    began = time.perf_counter()
    kernels = load_kernels(problem.robot, problem.layout, cache)
    prepared = time.perf_counter()
    solution = solve(problem)
    return {
        "success": solution.success,
        "status": solution.status,
        "final_time_s": solution.objective,
        "expected_s": EXPECTED_S,
        "tolerance_s": TOLERANCE_S,
        "iterations": solution.iterations,
        "solve_time_s": solution.solve_time,
        "prepare_time_s": prepared - began,
        "compiled": kernels.compiled,
        "linear_solver": solution.attempts[-1].linear_solver if solution.attempts else "none",
    }


if __name__ == "__main__":
    print(json.dumps(trial(Path(sys.argv[1]))))
