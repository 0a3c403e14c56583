"""All figures of one application, written into a folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from matplotlib.figure import Figure

from services.codesign.comparison import OWN
from services.report.answers import Answers
from services.report.box_chart import design_boxes
from services.report.convergence_chart import convergence_chart
from services.report.cross_section import motor_drawings
from services.report.heat_map import compared_methods, improvement_maps
from services.report.motion_chart import motion_chart
from services.report.motion_limits import motion_limits
from services.report.style import Format, save, style
from services.report.totals_chart import objective_label, totals_chart
from shared.contracts.comparisons import DesignsAnswer
from shared.contracts.motions import MotionResult, Trajectory

FEWEST_FOR_BOXES = 3
"""Quartiles of fewer designs say nothing."""

Draw = Callable[[], Figure]


def write_figures(answers: Answers, folder: Path, kind: Format = "svg") -> list[Path]:
    """Write every figure that the answers have the numbers for; the same answers give the same bytes.

    Parameters
    ----------
    answers
        Of one application.
    folder
        Made if it is not there.
    kind
        `svg`, `png` or `pdf`.

    Returns
    -------
    list of Path
        motors (the design, drawn to scale), designs (spread over the tasks), convergence (of the shared optimum),
        totals (of several tasks), improvement (heat maps, for a grid of tasks), motion-KKK-METHOD.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, draw in figures_of(answers):
        with style():
            figure = draw()
        written.append(save(figure, folder / f"{name}.{kind}"))
    return written


def figures_of(answers: Answers) -> Iterator[tuple[str, Draw]]:
    """Name of each figure that the answers have the numbers for, and what draws it, inside `style`."""
    method, motor = answers.application.method, answers.motor
    if (design := answers.design) is not None:
        yield "motors", lambda: motor_drawings(design, motor)
    if (designs := answers.designs) is not None and len(designs.tasks) >= FEWEST_FOR_BOXES:
        yield "designs", lambda: design_boxes(designs, method, motor)
    if designs is not None and (convergence := _convergence(designs)):
        yield "convergence", lambda: convergence_chart(convergence, objective_label(answers.application.objective.kind))
    comparison = answers.comparison
    if comparison is not None and comparison.tasks_compared and method in comparison.methods:
        if len(comparison.tasks_compared) > 1 and len(comparison.methods) > 1:
            yield "totals", lambda: totals_chart([comparison], method)
        if comparison.grid is not None and compared_methods(comparison, method):
            yield "improvement", lambda: improvement_maps([(comparison, answers.tasks)], method)
    for motion in answers.motions:
        yield f"motion-{motion.task:03d}-{motion.method}", lambda motion=motion: _motion(answers, motion)  # type: ignore[misc]


def _convergence(designs: DesignsAnswer) -> list[list[float]] | None:
    found = designs.methods.get("shared_optimum")
    return None if found is None else found.convergence


def _motion(answers: Answers, motion: Trajectory) -> Figure:
    task = answers.tasks.items[motion.task]
    result: MotionResult | None = task.own if motion.method == OWN else task.methods[motion.method]
    assert result is not None, "a motion has a result"
    return motion_chart(motion, motion_limits(motion, result, answers.robot), task.name)
