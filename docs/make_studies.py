"""Make every figure and table of docs/shared_optimum.md from what benchmarks/studies stored: `make studies`."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))  # benchmarks is no installed package

import numpy as np
from matplotlib.figure import Figure

from benchmarks.studies.records import Record, read, stored_sweep
from benchmarks.studies.tables import SHARED, margin_percent, sections, single_designs
from benchmarks.tables import put
from services.codesign.motor_data import MotorData
from services.report.box_chart import design_boxes
from services.report.front_chart import front_chart
from services.report.heat_map import signed
from services.report.style import BLUE, IMPROVEMENT, INK, QUIET, light_grid, method_name, new_figure, save, style
from services.report.totals_chart import totals_chart

PAGE = Path(__file__).parent / "shared_optimum.md"
IMAGES = Path(__file__).parent / "images"
FULL_COLOUR_PERCENT, PAPER_FULL_COLOUR_PERCENT = 60.0, 20.0
MARKERS = {"two_step": "s", "empirical": "^", "worst_case": "o"}
COLOURS = {"two_step": "#d98200", "empirical": "#8f4a8b", "worst_case": "#c8361d"}


def main() -> None:
    """Write the images, then the tables between the page's markers."""
    record = read("twelve_poses")["time"]
    paper = read("paper")["time"]
    front = stored_sweep("front")
    assert front is not None, "the front has not been run: python -m benchmarks.studies.sweeps"
    with style():
        figures = {
            "shared-totals": totals_chart([record.comparison], SHARED),
            "shared-single-designs": single_design_map(record),
            "shared-designs": design_boxes(record.designs, SHARED, MotorData()),
            "shared-convergence": convergence(record),
            "shared-applications": margins(read("twelve_applications")),
            "shared-front": front_chart(front),
            "shared-paper-maps": paper_maps(paper),
            "shared-paper-designs": design_boxes(paper.designs, SHARED, MotorData()),
            "shared-paper-convergence": convergence(paper),
        }
    for name, figure in figures.items():
        print(save(figure, IMAGES / f"{name}.png").name)
    for name, text in sections().items():
        put(name, text, PAGE)


def single_design_map(record: Record) -> Figure:
    """Every task with every task's own design: how much longer than with its own motors, in percent."""
    times, names = single_designs(), [task.name for task in record.designs.tasks]
    percent = 100 * (times / np.diag(times) - 1)
    figure = new_figure(10.0, 5.6)
    axes = figure.subplots()
    axes.imshow(-percent, cmap=IMPROVEMENT, vmin=-FULL_COLOUR_PERCENT, vmax=FULL_COLOUR_PERCENT, aspect="auto")
    for (row, column), value in np.ndenumerate(percent):
        ink = "white" if value > 0.55 * FULL_COLOUR_PERCENT else INK
        axes.text(column, row, signed(value), ha="center", va="center", fontsize=7.5, color=ink)
    axes.set_xticks(range(len(names)), names, rotation=35, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(names)), names)
    axes.set_xlabel("task")
    axes.set_ylabel("own design of")
    axes.set_title("Longer than with motors of its own [%]")
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    return figure


def paper_maps(record: Record) -> Figure:
    """By how much the shared optimum is faster than each other method, over strokes and payloads, in percent."""
    grid = record.comparison.grid
    assert grid is not None
    shape = len(grid.stroke), len(grid.payload_kg)
    figure = new_figure(11.0, 3.4)
    panels = figure.subplots(1, len(MARKERS))
    for axes, name in zip(panels, MARKERS, strict=True):
        ours, theirs = (np.array(record.objectives[m], dtype=float).reshape(shape).T for m in (SHARED, name))
        percent = 100 * (theirs - ours) / theirs
        full = PAPER_FULL_COLOUR_PERCENT
        axes.imshow(percent, cmap=IMPROVEMENT, vmin=-full, vmax=full, origin="lower")
        for (row, column), value in np.ndenumerate(percent):
            axes.text(
                column,
                row,
                signed(value),
                ha="center",
                va="center",
                fontsize=8,
                color="white" if abs(value) > 0.75 * full else INK,
            )
        axes.set_xticks(range(shape[0]), [f"{stroke:g}" for stroke in grid.stroke])
        axes.set_yticks(range(shape[1]), [f"{payload:g}" for payload in grid.payload_kg])
        axes.set_xlabel("stroke λ [rad]")
        axes.set_ylabel("payload [kg]")
        axes.set_title(f"less time than {method_name(name)} [%]")
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
    return figure


def convergence(record: Record) -> Figure:
    """The joint program's objective along its iterations, and the other designs' totals."""
    points = np.array(record.designs.methods[SHARED].convergence)
    figure = new_figure(9.0, 3.6)
    axes = figure.subplots()
    axes.plot(points[:, 0], points[:, 1], color=BLUE, label=f"joint program: {points[-1, 1]:.4f} s")
    for name in ("own", "two_step", "empirical", "worst_case"):
        total = record.judged(name)
        if total is not None:
            look = {"color": COLOURS.get(name, QUIET), "linewidth": 0.9, "linestyle": (0, (4, 3))}
            axes.axhline(total, label=f"{method_name(name)}: {total:.4f} s", **look)
    axes.set_xlabel("iteration")
    axes.set_ylabel("total time [s]")
    axes.set_title("The joint program from its start; points on the way do not obey all constraints yet")
    light_grid(axes)
    figure.legend(loc="outside right upper")
    return figure


def margins(records: dict[str, Record]) -> Figure:
    """How much worse than the shared optimum each other method is that does every task; crosses: it does not."""
    figure = new_figure(8.0, 4.2)
    axes = figure.subplots()
    for row, record in enumerate(records.values()):
        ours = record.judged(SHARED)
        for name, marker in MARKERS.items():
            theirs = record.judged(name)
            look = {"color": COLOURS[name], "markersize": 6, "markerfacecolor": "none", "linestyle": "none"}
            label = method_name(name) if row == 0 else None
            if ours is not None and theirs is not None:
                axes.plot(100 * (theirs - ours) / abs(ours), row, marker=marker, label=label, **look)
    axes.set_xscale("symlog", linthresh=1.0)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_yticks(range(len(records)), [_named(name, record) for name, record in records.items()])
    axes.invert_yaxis()
    axes.axvline(0, color=QUIET, linewidth=0.8)
    axes.set_xlabel("worse than the shared optimum [%], logarithmic above 1 %")
    axes.set_title("Methods that do every task, on twelve applications")
    light_grid(axes, "x")
    figure.legend(loc="outside lower right", ncols=3)
    return figure


def _named(name: str, record: Record) -> str:
    return name if margin_percent(record) is not None else f"{name} (alone)"


if __name__ == "__main__":
    main()
