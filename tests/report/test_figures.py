"""What the figures show against numbers worked out by hand, and the files that are written."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.patches import Circle, Rectangle

from services.codesign.motor_data import DIMENSIONS, MotorData
from services.report.answers import read_answers
from services.report.box_chart import design_boxes, overlaid_design_boxes
from services.report.cross_section import motor_drawings
from services.report.dimension_key import dimension_key
from services.report.figures import write_figures
from services.report.heat_map import improvement_maps, improvement_percent
from services.report.motion_chart import motion_chart
from services.report.motion_limits import motion_limits
from services.report.style import DIMENSION_SYMBOLS, Format, style
from services.report.totals_chart import totals_chart
from tests.report import answers as made_up

FIGURES = ["motors", "designs", "totals", "improvement", "motion-003-two_step"]
ROUNDING = 1e-12


@pytest.fixture(autouse=True)
def project_style() -> Iterator[None]:
    with style():
        yield


def texts(axes: Axes) -> list[str]:
    return [text.get_text() for text in axes.texts]


# Heat maps


def test_improvement_is_that_worked_out_by_hand() -> None:
    """Time saved of the other method's time: (2.2 - 1.1) / 2.2 = 50 %, (1.28 - 1.6) / 1.28 = -25 %, and so on."""
    tasks = made_up.tasks()
    assert improvement_percent(tasks, "two_step", "worst_case") == pytest.approx({0: 50, 1: -25, 2: 20, 3: 0})
    assert improvement_percent(tasks, "two_step", "empirical") == pytest.approx({0: -10, 1: 20, 2: 0})


def test_heat_map_writes_each_number_where_its_task_is() -> None:
    """Strokes to the right, payloads upwards; a task that only one method solved says so."""
    figure = improvement_maps([(made_up.comparison(), made_up.tasks())], "two_step")
    panels = {axes.get_title("left"): axes for axes in figure.axes}
    empirical, worst_case = (panels[f"time: two-step against {name}"] for name in ("empirical", "worst case"))
    cells = {text.get_position(): text.get_text() for text in worst_case.texts}
    assert cells == {(0, 0): "+50.0", (0, 1): "−25.0", (1, 0): "+20.0", (1, 1): "0.0"}
    cells = {text.get_position(): text.get_text() for text in empirical.texts}
    assert cells == {(0, 0): "−10.0", (0, 1): "+20.0", (1, 0): "0.0", (1, 1): "only\ntwo-step"}
    assert [label.get_text() for label in worst_case.get_xticklabels()] == ["0.5", "1"]
    assert [label.get_text() for label in worst_case.get_yticklabels()] == ["0", "3"]


def test_better_is_green_and_worse_red() -> None:
    figure = improvement_maps([(made_up.comparison(), made_up.tasks())], "two_step")
    axes = next(axes for axes in figure.axes if "worst case" in axes.get_title("left"))
    colours = {box.get_xy(): box.get_facecolor() for box in axes.patches if isinstance(box, Rectangle)}
    better, worse = colours[(-0.5, -0.5)], colours[(-0.5, 0.5)]
    assert better[1] > max(better[0], better[2])
    assert worse[0] > max(worse[1], worse[2])


def test_without_a_grid_or_another_method_there_is_no_heat_map() -> None:
    comparison, tasks = made_up.comparison(), made_up.tasks()
    with pytest.raises(ValueError, match="grid"):
        improvement_maps([(comparison.model_copy(update={"grid": None}), tasks)], "two_step")
    alone = comparison.model_copy(update={"methods": {"two_step": comparison.methods["two_step"]}})
    with pytest.raises(ValueError, match="no method"):
        improvement_maps([(alone, tasks)], "two_step")


# Box charts


def test_boxes_are_quartiles_and_marks_the_designs() -> None:
    """Stack lengths of motor 1: 20, 24, 28, 40 mm; quartiles 23, 26, 31; mean 28."""
    figure = design_boxes(made_up.designs(), "two_step", made_up.MOTOR, ["L"])
    (axes,) = figure.axes
    box = axes.patches[0].get_path().vertices
    assert (box[:, 1].min(), box[:, 1].max()) == pytest.approx((23, 31))
    marks = {line.get_marker(): line.get_ydata() for line in axes.lines if len(np.atleast_1d(line.get_xdata())) == 2}
    assert marks["_"] == pytest.approx([28, 40])  # mean
    assert marks["D"] == pytest.approx([28, 40])  # chosen
    assert marks["^"] == pytest.approx([28, 40])  # empirical: the third task's own
    assert marks["o"] == pytest.approx([40, 40])  # worst case: the last one's
    assert axes.get_ylabel() == "$L$ [mm]"


def test_bounds_in_view_are_drawn() -> None:
    (axes,) = design_boxes(made_up.designs(), "two_step", made_up.MOTOR, ["L"]).axes
    level = [line.get_ydata()[0] for line in axes.lines if list(line.get_xdata()) == [0, 1]]
    assert level == pytest.approx([20])


def test_two_applications_are_drawn_side_by_side() -> None:
    figure = overlaid_design_boxes({"time": made_up.designs(), "energy": made_up.designs()}, made_up.MOTOR)
    assert [axes.get_ylabel() for axes in figure.axes] == ["$L$ [mm]", "$R_{so}$ [mm]"]
    boxes = [patch for patch in figure.axes[0].patches if not isinstance(patch, Rectangle)]
    assert len(boxes) == 4  # two motors, twice
    red, blue = (boxes[k].get_edgecolor() for k in (0, 2))
    assert red[0] > red[2]
    assert blue[2] > blue[0]


# Motors


def test_motors_are_drawn_to_one_scale() -> None:
    """Circles from the outside in, and the stack's rectangle: in mm they are the design's lengths."""
    figure = motor_drawings(made_up.design(), made_up.MOTOR)
    (axes,) = figure.axes
    width, height = figure.get_size_inches()
    assert (axes.get_xlim(), axes.get_ylim()) == ((0, width), (0, height))  # the page's inches, the same in x and y
    radii = np.array([patch.get_radius() for patch in axes.patches if isinstance(patch, Circle)]).reshape(2, -1)
    scale = radii[0, 0] / 30
    assert radii / scale == pytest.approx(np.array([[30, 18.5, 15], [29, 12.5, 10.5]]))
    lengths = [patch.get_height() / scale for patch in axes.patches if isinstance(patch, Rectangle)]
    assert lengths == pytest.approx([20] * 5 + [40] * 5)
    assert {"20.00", "40.00", "18.00", "0.45"} <= set(texts(axes))  # 0.45 kg: Table I's motor


def test_key_names_each_length_and_its_value() -> None:
    (axes,) = dimension_key(made_up.TABLE_I_MM, made_up.MOTOR).axes
    written = texts(axes)
    for name, value in zip(DIMENSIONS, made_up.TABLE_I_MM, strict=True):
        assert DIMENSION_SYMBOLS[name] in written
        assert f"{value:g}" in written


def test_motors_of_another_winding_are_not_drawn() -> None:
    with pytest.raises(ValueError, match="another application"):
        motor_drawings(made_up.design(), replace(MotorData(), air_gap=1e-3))


# Motions and totals


def test_limits_are_found_from_the_peaks() -> None:
    limits = motion_limits(made_up.motion(), made_up.result(1.0), robot=None)
    for found, limit in (
        (limits.joint_speed, made_up.SPEED_LIMIT),
        (limits.joint_torque, made_up.TORQUE_LIMITS[0]),
        (limits.current, made_up.CURRENT_LIMIT),
        (limits.voltage, made_up.VOLTAGE_LIMIT),
    ):
        assert found[0] == pytest.approx(limit, rel=ROUNDING)
        assert np.isnan(found[1]), "a joint that stands still says nothing about its limit"


def lines(axes: Axes, label: str) -> list[np.ndarray]:
    """Points (m, 2) of each joint's line."""
    return next(found for found in axes.collections if found.get_label() == label).get_segments()  # type: ignore[attr-defined,no-any-return]


def test_motion_chart_has_a_row_for_each_quantity() -> None:
    """With a line for each joint, the second one's to the right of the first one's."""
    motion = made_up.motion()
    figure = motion_chart(motion, motion_limits(motion, made_up.result(1.0), None), "a task")
    labels = [axes.get_ylabel().replace("\n", " ") for axes in figure.axes]
    assert labels == ["position [rad]", "joint speed [rad/s]", "joint torque [N m]", "current [A]", "voltage [V]"]
    first, second = lines(figure.axes[3], "q")
    assert first[:, 1] == pytest.approx([row[0] for row in motion.current_q_A])
    assert first[:, 0] == pytest.approx([0, 0.25, 0.5, 0.75, 1])
    assert second[0, 0] > first[-1, 0]


def test_voltages_are_steps_only_where_they_are_constant() -> None:
    """A voltage holds on the interval that ends at its point."""
    motion = made_up.motion()
    limits = motion_limits(motion, made_up.result(1.0), None)
    given = [row[0] for row in motion.voltage_q_V]
    held = lines(motion_chart(motion, limits, "a task").axes[4], "q")[0]
    assert held[:, 1] == pytest.approx([given[0], *np.repeat(given[1:], 2)])
    assert held[:, 0] == pytest.approx([0, 0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1])
    smooth = motion.control.model_copy(update={"kind": "piecewise_polynomial"})
    motion = motion.model_copy(update={"control": smooth})
    assert lines(motion_chart(motion, limits, "a task").axes[4], "q")[0][:, 1] == pytest.approx(given)


def test_limits_of_a_motion_are_drawn_where_they_are_or_written() -> None:
    """Currents up to half of their limit are drawn without it; up to nine tenths, with it."""
    motion = made_up.motion()
    limits = motion_limits(motion, made_up.result(1.0), None)
    far = motion_chart(motion, limits, "a task").axes[3]
    assert texts(far) == ["limit ±3"]
    assert not list(far.patches)
    grown = [[1.8 * value for value in row] for row in motion.current_q_A]
    near = motion_chart(motion.model_copy(update={"current_q_A": grown}), limits, "a task").axes[3]
    assert texts(near) == []
    assert sorted(box.get_y() for box in near.patches if isinstance(box, Rectangle)) == [-3, 3]


def test_totals_are_written_beside_their_bars() -> None:
    """own 1 + 1.5 + 2 = 4.5; two-step 1.1 + 1.6 + 2.2 = 4.9, 8.9 % more."""
    left, _ = totals_chart([made_up.comparison()], "two_step").axes
    assert texts(left) == ["4.5", "4.9  (+8.9 %)", "5.2  (+15.6 %)", "6.23  (+38.4 %)"]
    assert left.get_xlabel() == "total time [s]"


# Files


def test_every_axis_has_its_unit() -> None:
    motion = made_up.motion()
    figures: list[Figure] = [
        improvement_maps([(made_up.comparison(), made_up.tasks())], "two_step"),
        design_boxes(made_up.designs(), "two_step", made_up.MOTOR),
        motion_chart(motion, motion_limits(motion, made_up.result(1.0), None), "a task"),
        totals_chart([made_up.comparison()], "two_step"),
    ]
    without_unit = {"", "motor of joint"}
    for figure in figures:
        labels = {label for axes in figure.axes for label in (axes.get_xlabel(), axes.get_ylabel())} - without_unit
        assert labels
        assert all("[" in label for label in labels)


@pytest.mark.parametrize("kind", ["svg", "png"])
def test_files_are_whole_and_the_same_again(kind: Format, tmp_path: Path) -> None:
    first = write_figures(made_up.answers(), tmp_path / "first", kind)
    again = write_figures(made_up.answers(), tmp_path / "again", kind)
    assert [path.name for path in first] == [f"{name}.{kind}" for name in FIGURES]
    for path, same in zip(first, again, strict=True):
        assert path.read_bytes() == same.read_bytes()
        if kind == "svg":
            assert ElementTree.parse(path).getroot().tag.endswith("svg")
        else:
            pixels = imread(path)
            assert pixels.shape[2] == 3 or pixels[:, :, 3].min() == 1, "opaque"
            assert pixels.min() < pixels.max()


def test_what_has_no_numbers_is_left_out(tmp_path: Path) -> None:
    nothing = replace(made_up.answers(), design=None, designs=None, comparison=None, motions=())
    assert write_figures(nothing, tmp_path) == []


def test_answers_are_read_from_the_folder_of_a_run(tmp_path: Path) -> None:
    """The middle task's motion, and the motor's constants from the request."""
    given = made_up.answers()
    (tmp_path / "trajectories").mkdir()
    for name, answer in (("application", given.application), ("tasks", given.tasks), ("designs", given.designs)):
        assert answer is not None
        (tmp_path / f"{name}.json").write_text(answer.model_dump_json())
    (tmp_path / "trajectories" / "task-002-two_step.json").write_text(made_up.motion(2).model_dump_json())
    (tmp_path / "request.json").write_text('{"robot": "ur5", "motor": {"air_gap_mm": 0.75}}')
    read = read_answers(tmp_path)
    assert (read.tasks, read.designs, read.design, read.comparison) == (given.tasks, given.designs, None, None)
    assert [motion.task for motion in read.motions] == [2]
    assert read.motor.air_gap == pytest.approx(0.75e-3)
    assert read.robot is not None
    assert read.robot.joints == 6
