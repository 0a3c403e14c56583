"""Error against cost of the transcriptions, and the paper's 25 tasks at the default accuracy: docs/accuracy.md.

python -m benchmarks.accuracy            tables as Markdown, on one core
python -m benchmarks.accuracy --plot docs/images/accuracy.png
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from services.codesign.accuracy import solve_accurately
from services.codesign.certify import Certificate, certify
from services.codesign.problem import FIRST, Accuracy, Objective, Problem, Task, Transcription
from services.codesign.program import load_program
from services.codesign.robot import Robot
from services.codesign.solve import SolverOptions, solve

UR5 = Robot.preset("ur5")
STROKES = (0.2, 0.4, 0.6, 0.8, 1.0)
PAYLOADS = (0.0, 1.0, 2.0, 3.0, 4.0)
PAPER = Transcription()
TASKS = ((0.2, 0.0), (0.6, 2.0), (1.0, 4.0))
"""Stroke [rad] and payload [kg] of the tasks that the transcriptions are compared on."""

COMPARED = (
    PAPER,
    Transcription("radau", 2, 50),
    Transcription("radau", 3, 50),
    *(Transcription("radau", d, N, "current") for d in (1, 2, 3, 4) for N in (25, 50, 100)),
    *(Transcription("legendre", d, 50, "current") for d in (1, 2, 3)),
)
REPEATS = 2
"""Solves of each problem; the faster one counts, for the machine has other things to do."""


@dataclass(frozen=True)
class Run:
    """One task solved, certified and timed."""

    transcription: Transcription
    objective: float
    iterations: int
    solve_seconds: float
    certify_seconds: float
    certificate: Certificate


def problem(stroke: float, payload: float, transcription: Transcription) -> Problem:
    """A task of the paper, for time."""
    task = Task(np.full(6, stroke), np.zeros(6), payload)
    return Problem(UR5, task, objective=Objective("time"), transcription=transcription)


def run(given: Problem) -> Run | None:
    """Solve from cold and certify; None when there is no solution."""
    runs = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        solution = solve(given)
        solved = time.perf_counter()
        if not solution.success or solution.objective is None:
            return None
        certificate = certify(solution)
        done = time.perf_counter()
        runs.append(
            Run(
                given.transcription,
                solution.objective,
                solution.iterations,
                solved - began,
                done - solved,
                certificate,
            )
        )
    return min(runs, key=lambda r: r.solve_seconds + r.certify_seconds)


def name(transcription: Transcription) -> str:
    """Such as `radau 3, 50, current`."""
    return f"{transcription.scheme} {transcription.degree}, {transcription.intervals}, {transcription.control}"


@dataclass(frozen=True)
class Row:
    """A transcription over the tasks."""

    transcription: Transcription
    seconds: float  # all tasks, certificates included
    position: float  # rad, worst
    excess: float  # share of a limit, worst


def compare(transcriptions: Iterable[Transcription]) -> list[Row]:
    """Print a row for each transcription: the worst over the tasks, time added up."""
    print(
        "| transcription | variables | t_f s, 3 tasks | replay rad | rad/s | over a limit between points | s, 3 tasks |"
    )
    print("|---|---|---|---|---|---|---|")
    found = []
    for transcription in transcriptions:
        size = load_program(UR5, transcription.layout(6), transcription.intervals).variables
        runs = [run(problem(*task, transcription)) for task in TASKS]
        solved = [r for r in runs if r is not None]
        times = ", ".join("-" if r is None else f"{r.objective:.4f}" for r in runs)
        position, speed, excess = worst(r.certificate for r in solved)
        seconds = sum(r.solve_seconds + r.certify_seconds for r in solved)
        cells = [name(transcription), str(size), times, f"{position:.1e}", f"{speed:.1e}", f"{excess:.2%}"]
        print_row(*cells, f"{seconds:.2f}")
        found.append(Row(transcription, seconds, position, excess))
    return found


def worst(certificates: Iterable[Certificate]) -> tuple[float, float, float]:
    """Largest replay error [rad], [rad/s], and excess over a limit; infinite where a replay broke off."""
    rows = [
        (
            np.inf if c.replay_position is None else c.replay_position,
            np.inf if c.replay_speed is None else c.replay_speed,
            c.limit_violation,
        )
        for c in certificates
    ]
    position, speed, excess = np.max(rows, axis=0)
    return float(position), float(speed), float(excess)


def grid() -> None:
    """The 25 tasks with the paper's transcription and at the default accuracy, in turn: both see one machine."""
    for transcription in (PAPER, FIRST):  # programs and kernels are made once
        solve(problem(0.6, 2.0, transcription))
    rows = []
    for stroke in STROKES:
        for payload in PAYLOADS:
            paper = run(problem(stroke, payload, PAPER))
            assert paper is not None
            seconds = []
            for _ in range(REPEATS):
                began = time.perf_counter()
                default = solve_accurately(problem(stroke, payload, PAPER), Accuracy(), SolverOptions())
                seconds.append(time.perf_counter() - began)
            assert default.certificate is not None
            rows.append((paper, default, min(seconds)))
    paper_seconds = sum(p.solve_seconds + p.certify_seconds for p, _, _ in rows)
    default_seconds = sum(seconds for _, _, seconds in rows)
    papers = [p.certificate for p, _, _ in rows]
    defaults = [d.certificate for _, d, _ in rows if d.certificate is not None]
    print_row("", "paper", "default")
    print("|---|---|---|")
    kept = [sum(c.meets(Accuracy()) for c in certificates) for certificates in (papers, defaults)]
    print_row("within 1 mrad, 10 mrad/s, limits to 0.1 percent", *(f"{count} of {len(rows)}" for count in kept))
    for label, k, form in (
        ("largest replay error rad", 0, ".1e"),
        ("largest replay error rad/s", 1, ".1e"),
        ("most over a limit between points", 2, ".2%"),
    ):
        print_row(label, *(f"{worst(certificates)[k]:{form}}" for certificates in (papers, defaults)))
    times = [sum(p.objective for p, _, _ in rows), sum(d.solution.objective or np.nan for _, d, _ in rows)]
    print_row("total minimum time s", *(f"{value:.4f}" for value in times))
    print_row("tasks refined again", "", str(sum(len(d.rounds) > 1 for _, d, _ in rows)))
    ratio = f"{default_seconds:.2f} ({default_seconds / paper_seconds:.2f} times)"
    print_row("s of solving and certifying", f"{paper_seconds:.2f}", ratio)


def print_row(*cells: str) -> None:
    """One row of a Markdown table."""
    print("| " + " | ".join(cells) + " |", flush=True)


def plot(rows: list[Row], path: Path) -> None:
    """Replay error and excess over limits against time; a line for each kind, a point for each number of intervals."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot, ticker

    figure, panels = pyplot.subplots(1, 2, figsize=(9, 3.8), sharex=True, layout="constrained")
    kinds = dict.fromkeys((r.transcription.scheme, r.transcription.degree, r.transcription.control) for r in rows)
    for kind in kinds:
        mine = [r for r in rows if (r.transcription.scheme, r.transcription.degree, r.transcription.control) == kind]
        style = "o-" if kind[2] == "current" else "s-"
        seconds = [r.seconds for r in mine]
        panels[0].loglog(seconds, [r.position for r in mine], style, label=" ".join(map(str, kind)), markersize=5)
        panels[1].loglog(seconds, [max(r.excess, 1e-6) for r in mine], style, markersize=5)
        for axes, values in zip(panels, ([r.position for r in mine], [max(r.excess, 1e-6) for r in mine]), strict=True):
            for row, value in zip(mine, values, strict=True):
                axes.annotate(f" {row.transcription.intervals}", (row.seconds, value), fontsize=6)
    panels[0].axhline(Accuracy().position, color="grey", linewidth=0.8)
    panels[1].axhline(Accuracy().limit, color="grey", linewidth=0.8)
    panels[0].set_ylabel("replay error at t_f [rad]")
    panels[1].set_ylabel("excess over a limit, share (1e-6: none)")
    for axes in panels:
        axes.set_xlabel("three solves and certificates [s]")
        axes.grid(alpha=0.3)
        axes.xaxis.set_minor_formatter(ticker.NullFormatter())
        axes.xaxis.set_major_formatter(ticker.FormatStrFormatter("%g"))
    figure.legend(loc="outside right upper", fontsize=7)
    figure.savefig(path, dpi=130)


def main() -> None:
    """Run all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plot", type=Path, help="where the figure goes")
    parser.add_argument("--only", choices=("compare", "grid"))
    options = parser.parse_args()
    if options.only != "grid":
        rows = compare(COMPARED)
        if options.plot is not None:
            plot(rows, options.plot)
    if options.only != "compare":
        grid()


if __name__ == "__main__":
    main()
