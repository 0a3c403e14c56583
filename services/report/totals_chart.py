"""Bar charts of the methods' totals, and of their regret against the tasks' own optima."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter

from services.codesign.comparison import OWN
from services.report.heat_map import signed
from services.report.style import CHOSEN, INK, QUIET, light_grid, method_name, new_figure
from shared.contracts.comparisons import ComparisonAnswer

BAR_HEIGHT = 0.62
OTHER = "#a9b4bb"
OWN_COLOUR = "#d5dadd"
WORDS = {
    "time": "total time",
    "energy": "total energy, ∫u'u dt",
    "weighted": "total weighted objective",
    "electrical_energy": "total electrical energy",
}
LINEAR_TO, LINEAR_WITHIN = 100.0, 10.0  # percent
"""A regret beyond the first makes the axis logarithmic above the second."""
UNITS = {"time": "s", "energy": "V² s", "weighted": "1", "electrical_energy": "J"}


def objective_label(kind: str) -> str:
    """What is added up over the tasks, with its unit, for an axis."""
    return f"{WORDS[kind]} [{UNITS[kind]}]"


def totals_chart(comparisons: Sequence[ComparisonAnswer], method: str) -> Figure:
    """A row an application: totals on the left, regret on the right, the application's method coloured.

    The circles are the tasks one by one, the bar is the regret of the total.

    Parameters
    ----------
    comparisons
        At least one, each with at least one method besides `own`.
    method
        The applications' method.
    """
    heights = [0.36 * len(comparison.methods) + 0.95 for comparison in comparisons]
    figure = new_figure(10.5, sum(heights))
    panels = figure.subplots(len(comparisons), 2, squeeze=False, height_ratios=heights)
    for (left, right), comparison in zip(panels, comparisons, strict=True):
        names = sorted(comparison.methods, key=lambda name: (name != OWN, comparison.methods[name].total_objective))
        _totals(left, comparison, names, method)
        _regret(right, comparison, names, method)
    return figure


def _totals(axes: Axes, comparison: ComparisonAnswer, names: list[str], method: str) -> None:
    values = [comparison.methods[name].total_objective for name in names]
    colours = [OWN_COLOUR if name == OWN else CHOSEN if name == method else OTHER for name in names]
    axes.barh(range(len(names)), values, BAR_HEIGHT, color=colours)
    for k, (name, value) in enumerate(zip(names, values, strict=True)):
        regret = comparison.regret[name].total if name in comparison.regret else None
        text = f"{value:.5g}" if regret is None else f"{value:.5g}  ({signed(100 * regret)} %)"
        axes.annotate(text, (value, k), (4, 0), textcoords="offset points", va="center", fontsize=8)
    axes.axvline(values[0], color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)))
    axes.set_xlim(0, 1.35 * max(values))
    _name_methods(axes, names)
    axes.set_xlabel(objective_label(comparison.objective))
    axes.set_title(
        f"{comparison.objective}: totals over the {len(comparison.tasks_compared)} tasks that every method solved"
    )


def _regret(axes: Axes, comparison: ComparisonAnswer, names: list[str], method: str) -> None:
    """In percent; a task lies left of zero when its own optimum is beaten, by another local one."""
    smallest, largest = 0.0, 0.0
    for k, name in enumerate(names):
        if name not in comparison.regret or (total := comparison.regret[name].total) is None:
            continue
        tasks = [100 * value for value in comparison.regret[name].per_task if value is not None]
        smallest, largest = min(smallest, *tasks), max(largest, *tasks)
        axes.plot(tasks, [k] * len(tasks), "o", markersize=4.5, markerfacecolor="none", markeredgecolor=INK, alpha=0.7)
        colour = CHOSEN if name == method else OTHER
        axes.plot([100 * total] * 2, [k - BAR_HEIGHT / 2, k + BAR_HEIGHT / 2], color=colour, linewidth=4, zorder=1.5)
    axes.axvline(0, color=QUIET, linewidth=0.8)
    label = "regret against the own designs [%]"
    if largest > LINEAR_TO:
        axes.set_xscale("symlog", linthresh=LINEAR_WITHIN, linscale=0.6)
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.set_xlim(smallest - 0.1 * LINEAR_WITHIN, 1.4 * largest)
        label += f", logarithmic above {LINEAR_WITHIN:g} %"
    _name_methods(axes, names)
    axes.set_yticklabels([])
    axes.set_xlabel(label)
    axes.set_title(f"{comparison.objective}: regret (bar: of the total, circles: of each task)")


def _name_methods(axes: Axes, names: list[str]) -> None:
    axes.set_yticks(range(len(names)), [method_name(name) for name in names])
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    light_grid(axes, "x")
