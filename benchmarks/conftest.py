"""Tables of docs/performance.md from what pytest-benchmark measured, written when it is asked for its JSON file."""

from __future__ import annotations

import statistics
from typing import Any

from benchmarks.tables import put, table

AGAINST, ALL, PARTS = "against", "all", "parts"
"""Groups of benchmarks: pairs on a task are "against: TASK"."""


def pytest_benchmark_update_json(output_json: dict[str, Any]) -> None:
    """Called by pytest-benchmark with all that it is about to write."""
    found = output_json["benchmarks"]
    pairs = [entry for entry in found if entry["group"].startswith(AGAINST)]
    all_tasks = [entry for entry in found if entry["group"] == ALL]
    parts = [entry for entry in found if entry["group"] == PARTS]
    if pairs:
        put("baseline", against_table(pairs, all_tasks))
    if parts:
        put("parts", parts_table(parts))


def against_table(entries: list[dict[str, Any]], all_tasks: list[dict[str, Any]]) -> str:
    """A row for each task, the paper's formulation and ours side by side; then medians, and ours over all tasks."""
    rows, ratios, theirs_s = [], [], []
    for group in dict.fromkeys(entry["group"] for entry in entries):
        both = {entry["name"].partition("[")[0]: entry for entry in entries if entry["group"] == group}
        theirs, ours = both["test_paper_formulation"], both["test_ours"]
        together, seconds = theirs["stats"]["median"], ours["stats"]["median"]
        alone = theirs["extra_info"]["solve_s"]
        ratios.append((together / seconds, alone / seconds))
        theirs_s.append((together, alone))
        rows.append(
            [
                group.partition(": ")[2],
                f"{together - alone:.1f}",
                f"{alone:.1f}",
                str(theirs["extra_info"]["iterations"]),
                f"{seconds:.3f}",
                *_iterations(ours),
                *(f"{ratio:.0f}" for ratio in ratios[-1]),
                f"{theirs['extra_info']['optimum_s']:.6f}",
                f"{ours['extra_info']['optimum_s']:.6f}",
            ]
        )
    medians = [f"**{statistics.median(column):.0f}**" for column in zip(*ratios, strict=True)]
    rows.append(["median", "", "", "", "", "", "", *medians, "", ""])
    for entry in all_tasks:
        seconds = entry["extra_info"]["median_s"]
        faster = [f"**{statistics.median(column) / seconds:.0f}**" for column in zip(*theirs_s, strict=True)]
        ours = [f"{seconds:.3f}", *_iterations(entry)]
        rows.append(["ours over all 25 tasks, median", "", "", "", *ours, *faster, "", ""])
    head = ["task", "paper's formulation: differentiated s", "solved s", "iterations", "ours s", "iterations", "coarse"]
    return table([*head, "times faster", "than its solve alone", "its optimum s, tol 1e-8", "ours"], rows)


def _iterations(entry: dict[str, Any]) -> list[str]:
    """On the task's own grid, and on the coarse one before it."""
    return [str(entry["extra_info"][key]) for key in ("iterations", "coarse_iterations")]


def parts_table(entries: list[dict[str, Any]]) -> str:
    """A row for each part: median, spread, rounds."""
    rows = []
    for entry in entries:
        stats, name = entry["stats"], entry["extra_info"]["part"]
        rows.append([name, *(f"{1e3 * stats[key]:.3g}" for key in ("median", "min", "iqr")), str(stats["rounds"])])
    return table(["part", "CPU ms, median", "least", "between quartiles", "rounds"], rows)
