"""Make every figure of docs/paper_study.md, and print its numbers, from two runs of the paper's application.

1. armature run examples/pick_and_place.yaml
2. armature run examples/pick_and_place_energy.yaml
3. python docs/make_figures.py out/pick-and-place-ID out/pick-and-place-energy-ID
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from services.codesign.motor_data import DIMENSIONS
from services.report.answers import Answers, read_answers
from services.report.box_chart import design_boxes, overlaid_design_boxes
from services.report.cross_section import motor_drawings
from services.report.dimension_key import dimension_key
from services.report.heat_map import improvement_maps
from services.report.motion_chart import motion_chart
from services.report.motion_limits import motion_limits
from services.report.style import save, style
from services.report.totals_chart import totals_chart
from shared.contracts.comparisons import ComparisonAnswer, DesignAnswer, DesignsAnswer

IMAGES = Path(__file__).parent / "images"
METHOD = "two_step"
TABLE_I_MM = (20, 18, 30, 3, 5, 7, 2)
"""The paper's example of a motor."""


def main(time_folder: Path, energy_folder: Path) -> None:
    """Write docs/images/*.png and print what the page quotes."""
    IMAGES.mkdir(exist_ok=True)
    time, energy = read_answers(time_folder), read_answers(energy_folder)
    with style():
        figures = draw(time, energy)
    for name, figure in figures.items():
        path = save(figure, IMAGES / f"{name}.png")
        print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB")
    print_numbers(time)
    print_numbers(energy)


def draw(time: Answers, energy: Answers) -> dict[str, Figure]:
    """All figures, by name of the file."""
    both = [(comparison_of(answers), answers.tasks) for answers in (time, energy)]
    (motion,) = time.motions
    result = time.tasks.items[motion.task].methods[motion.method]
    limits = motion_limits(motion, result, time.robot)
    return {
        "dimensions": dimension_key(TABLE_I_MM, time.motor),
        "motors-time": motor_drawings(design_of(time), time.motor),
        "motors-energy": motor_drawings(design_of(energy), energy.motor),
        "improvement": improvement_maps(both, METHOD),
        "designs": overlaid_design_boxes({"time": designs_of(time), "energy": designs_of(energy)}, time.motor),
        "designs-time": design_boxes(designs_of(time), METHOD, time.motor),
        "totals": totals_chart([comparison for comparison, _ in both], METHOD),
        "motion": motion_chart(motion, limits, time.tasks.items[motion.task].name),
    }


def print_numbers(answers: Answers) -> None:
    """Totals, regret, failures, and how far the tasks' own designs lie apart."""
    comparison, designs = comparison_of(answers), designs_of(answers)
    print(f"\n{answers.application.name}: {len(comparison.tasks_compared)} tasks compared, {comparison.unit}")
    for name, totals in comparison.methods.items():
        regret = comparison.regret[name].total if name in comparison.regret else None
        more = "" if regret is None else f", regret {100 * regret:.2f} %"
        print(f"  {name}: {totals.total_objective:.4f}{more}")
    for method in answers.application.methods:
        failed = [task.name for task in answers.tasks.items if method not in task.methods]
        print(f"  without a motion, {method}: {', '.join(failed) or 'none'}")
    own = np.array([task.design_mm for task in designs.tasks])
    spread = 100 * own.std(axis=0) / own.mean(axis=0)
    print("  standard deviation over mean, percent, joint by joint:")
    for k, name in enumerate(DIMENSIONS):
        print(f"    {name}: {', '.join(f'{value:.1f}' for value in spread[:, k])}")
    grid = comparison.grid
    if grid is not None and len(own) == len(grid.stroke) * len(grid.payload_kg):
        heights = own[:, 1, DIMENSIONS.index("h_m")].reshape(len(grid.stroke), -1)
        print(f"  magnets of motor 2, mm, a row for each stroke:\n{np.array2string(heights, precision=2)}")


def comparison_of(answers: Answers) -> ComparisonAnswer:
    """There is one after a run that ended well."""
    assert answers.comparison is not None, f"{answers.application.name} has no comparison"
    return answers.comparison


def designs_of(answers: Answers) -> DesignsAnswer:
    """There are some after a run that ended well."""
    assert answers.designs is not None, f"{answers.application.name} has no designs"
    return answers.designs


def design_of(answers: Answers) -> DesignAnswer:
    """There is one after a run that ended well."""
    assert answers.design is not None, f"{answers.application.name} has no design"
    return answers.design


if __name__ == "__main__":
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
