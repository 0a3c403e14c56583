"""Memory of a solver process: `python -m benchmarks.memory [--solves 1 25 100 500] [--grids 12]`.

One process solves and certifies the paper's tasks again and again; then one task on ever other grids, each of which has
a program and a solver object of its own. The figure is the resident memory after it (`/proc`, so on Linux alone).
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from dataclasses import replace
from itertools import cycle
from pathlib import Path

from benchmarks.solve_time import PAYLOADS, STROKES, paper_problem
from benchmarks.tables import put, table
from services.codesign.certify import certify
from services.codesign.problem import Problem, Transcription
from services.codesign.solve import solve

FIRST_GRID, APART = 30, 5
"""Intervals of the grids."""


def resident_mb() -> float:
    """Memory of this process that is in use [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def tasks() -> Iterator[Problem]:
    """The paper's, for ever."""
    return cycle([paper_problem(stroke, payload) for stroke in STROKES for payload in PAYLOADS])


def main() -> None:
    """Measure, and write the section of docs/performance.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--solves", type=int, nargs="+", default=[1, 25, 100, 500])
    parser.add_argument("--grids", type=int, default=12)
    arguments = parser.parse_args()
    rows = [["imported", f"{resident_mb():.0f}"]]
    endless, done = tasks(), 0
    for count in arguments.solves:
        while done < count:
            certify(solve(next(endless)))
            done += 1
        rows.append([f"{count} solves", f"{resident_mb():.0f}"])
    for k in range(arguments.grids):
        grid = Transcription(intervals=FIRST_GRID + APART * k)
        certify(solve(replace(paper_problem(0.2, 0.0), transcription=grid)))
        if (k + 1) % 4 == 0:
            rows.append([f"… and {k + 1} other grids, up to {grid.intervals} intervals", f"{resident_mb():.0f}"])
    put("memory", table(["after", "resident MB"], rows))


if __name__ == "__main__":
    main()
