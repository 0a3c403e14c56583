"""The paper's 25 tasks for every objective, and where the time goes: `python -m benchmarks.solve_time`.

CPU time of one core. What only happens once a process (importing, loading kernels, building programs) is not counted.
"""

from __future__ import annotations

import re
import tempfile
import time
from pathlib import Path

import casadi as ca
import numpy as np

from benchmarks.tables import put, table
from services.codesign import solver as solver_module
from services.codesign.elimination import elimination
from services.codesign.guess import quintic_guess, starting_design
from services.codesign.instance import build_instance
from services.codesign.ladder import ON_COARSE
from services.codesign.problem import Objective, Problem, Task
from services.codesign.program import load_program
from services.codesign.robot import Robot
from services.codesign.solution import Solution
from services.codesign.solve import solve
from services.codesign.solver import CentralPath, SolverOptions
from services.codesign.staged_ldl import load_staged_ldl

UR5 = Robot.preset("ur5")
STROKES = (0.2, 0.4, 0.6, 0.8, 1.0)
PAYLOADS = (0.0, 1.0, 2.0, 3.0, 4.0)
TOL = 1e-6

COARSE_ATTEMPTS = (ON_COARSE, f"references: {ON_COARSE}")


def paper_problem(stroke: float, payload: float, kind: str = "time") -> Problem:
    """One of the paper's tasks."""
    task = Task(np.full(6, stroke), np.zeros(6), payload, duration=1.0)
    return Problem(UR5, task, objective=Objective(kind, 0.5))


def timed(problem: Problem, tol: float = TOL) -> tuple[float, Solution]:
    """CPU seconds of a whole solve, from the guess to the answer."""
    began = time.process_time()
    solution = solve(problem, options=SolverOptions(tol=tol))
    return time.process_time() - began, solution


def iterations_of(solution: Solution) -> tuple[int, int]:
    """On the task's own grid, and before them on the coarse one."""
    coarse = sum(attempt.iterations for attempt in solution.attempts if attempt.name in COARSE_ATTEMPTS)
    return solution.iterations - coarse, coarse


def all_tasks() -> str:
    """The 25 tasks for every objective, cold."""
    rows = []
    for kind in ("time", "energy", "weighted"):
        timed(paper_problem(0.6, 2.0, kind))
        runs = [timed(paper_problem(stroke, payload, kind)) for stroke in STROKES for payload in PAYLOADS]
        seconds = [run[0] for run in runs]
        own, coarse = zip(*(iterations_of(run[1]) for run in runs), strict=True)
        rows.append(
            [
                kind,
                f"{sum(run[1].success for run in runs)} of {len(runs)}",
                f"{np.median(seconds):.3f}",
                f"{max(seconds):.3f}",
                f"{np.median(own):.0f}",
                f"{max(own)}",
                f"{np.median(coarse):.0f}",
                f"{1e3 * sum(seconds) / sum(own):.1f}",
            ]
        )
    head = ["objective", "solved", "CPU s, median", "most", "iterations, median", "most", "on the coarse grid, median"]
    return table([*head, "ms an iteration of the task's grid, all included"], rows)


def shares() -> str:
    """Where the time of one solve goes, by IPOPT's and CasADi's own clocks, with our factorisation and with MUMPS."""
    problem = paper_problem(0.6, 2.0)
    program = load_program(problem.robot, problem.layout, problem.transcription.intervals)
    instance = build_instance(problem, program)
    start = quintic_guess(problem, program, instance, starting_design(problem))
    rows = []
    for name, staged in (("ours", load_staged_ldl()), ("MUMPS, ordered by METIS", None)):
        monitor = solver_module._Monitor()
        monitor.begin(None, 0, np.inf)
        options = solver_module._casadi_options(
            program, SolverOptions(), False, CentralPath.WHOLE, staged=staged, monitor=monitor
        )
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder) / "ipopt.log"
            more = {"output_file": str(log), "file_print_level": 5, "print_timing_statistics": "yes"}
            options["ipopt"] |= more
            solver = ca.nlpsol("shares", "ipopt", program.nlp, options)
            if staged is not None:
                staged.hand_over(elimination(program, instance))
            began = time.process_time()
            solver(**solver_module._arguments(instance, start))
            total, stats, text = time.process_time() - began, solver.stats(), log.read_text()
        functions = sum(value for key, value in stats.items() if key.startswith("t_proc_nlp_"))
        linear = _clock(text, "PDSystemSolverTotal")
        parts = (linear, functions, total - linear - functions)
        cells = [f"{1e3 * part:.0f} ({part / total:.0%})" for part in parts]
        rows.append([name, str(stats["iter_count"]), *cells, f"{1e3 * total:.0f}"])
    head = ["linear systems by", "iterations", "linear systems ms", "functions and derivatives ms", "rest of IPOPT ms"]
    return table([*head, "together ms"], rows)


def _clock(log: str, part: str) -> float:
    found = re.search(rf"{part}\.*:\s*([0-9.]+)", log)
    assert found is not None, f"IPOPT's log has no {part}"
    return float(found.group(1))


def main() -> None:
    """Measure, and write the sections of docs/performance.md."""
    put("tasks", all_tasks())
    put("shares", shares())


if __name__ == "__main__":
    main()
