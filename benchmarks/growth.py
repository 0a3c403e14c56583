"""Solve time against the number of intervals (25 to 400) and the degree (1 to 5).

python -m benchmarks.growth
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import matplotlib as mpl
import numpy as np

from benchmarks.solve_time import paper_problem, timed
from benchmarks.tables import ROOT, put, table
from benchmarks.test_against_baseline import THREE
from services.codesign.problem import Transcription

mpl.use("Agg")
from matplotlib import pyplot as plt

INTERVALS = (25, 50, 100, 200, 400)
DEGREES = (1, 2, 3, 4, 5)
IMAGE = ROOT / "docs" / "images" / "growth.svg"


def measured(transcription: Transcription) -> tuple[float, float, float]:
    """Median CPU s, iterations and ms an iteration over three tasks."""
    problems = [replace(paper_problem(*task), transcription=transcription) for task in THREE]
    timed(problems[0])
    runs = [timed(problem) for problem in problems]
    assert all(run[1].success for run in runs), transcription
    seconds, iterations = (
        np.array(part, dtype=float) for part in zip(*((s, r.iterations) for s, r in runs), strict=True)
    )
    return float(np.median(seconds)), float(np.median(iterations)), float(np.median(1e3 * seconds / iterations))


def section(name: str, values: Sequence[int], transcriptions: Sequence[Transcription]) -> list[float]:
    """Measure, write the table, and return the ms an iteration."""
    figures = [measured(transcription) for transcription in transcriptions]
    rows = [
        [str(value), f"{seconds:.2f}", f"{iterations:.0f}", f"{each:.1f}"]
        for value, (seconds, iterations, each) in zip(values, figures, strict=True)
    ]
    put(name, table([name, "CPU s", "iterations", "ms an iteration"], rows))
    return [each for _, _, each in figures]


def main() -> None:
    """Measure, write both tables and the plot."""
    by_intervals = section("intervals", INTERVALS, [Transcription(intervals=N) for N in INTERVALS])
    by_degree = section("degree", DEGREES, [Transcription(degree=d) for d in DEGREES])
    figure, axes = plt.subplots(1, 2, figsize=(8, 3), layout="constrained")
    for axis, x, y, name in (
        (axes[0], INTERVALS, by_intervals, "intervals, degree 1"),
        (axes[1], DEGREES, by_degree, "degree, 50 intervals"),
    ):
        axis.plot(x, y, "o-", color="black", linewidth=1)
        axis.set(xlabel=name, ylabel="ms an iteration", ylim=(0, None))
        axis.spines[["top", "right"]].set_visible(False)
    mpl.rcParams["svg.hashsalt"] = "growth"
    figure.savefig(IMAGE, metadata={"Date": None})


if __name__ == "__main__":
    main()
