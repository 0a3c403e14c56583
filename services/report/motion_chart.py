"""One motion over time: positions, speeds, torques, currents and voltages of every joint, against their limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from services.report.motion_limits import MotionLimits
from services.report.style import BLUE, INK, ORANGE, QUIET, light_grid, method_name, new_figure, shade_outside
from shared.contracts.motions import Trajectory

COLUMN, ROW = 2.0, 1.45  # inches
HEADROOM = 1.12
"""Axes end a little beyond the limit, so that it is in view."""
MS = 1e3  # ms per s

HELD = "piecewise_constant"
"""Kind of control in which the voltage at a point holds on the interval that ends there."""


@dataclass(frozen=True)
class _Line:
    values: npt.NDArray[np.float64]  # (points, n)
    colour: str
    label: str


@dataclass(frozen=True)
class _Row:
    label: str
    lines: tuple[_Line, ...]
    low: npt.NDArray[np.float64]  # (n,), NaN where unknown
    high: npt.NDArray[np.float64]
    steps: bool


def motion_chart(motion: Trajectory, limits: MotionLimits, title: str) -> Figure:
    """A column for each joint, a row for each quantity; beyond the limits is grey.

    Parameters
    ----------
    motion
        On its grid.
    limits
        Of the same motion.
    title
        What the motion is, such as the task's name.
    """
    rows = _rows(motion, limits)
    joints = len(motion.joint_position_rad[0])
    figure = new_figure(COLUMN * joints + 0.6, ROW * len(rows) + 0.9)
    panels = figure.subplots(len(rows), joints, sharex=True, sharey="row", squeeze=False)
    time = MS * np.array(motion.time_s)
    for row, axes_of_row in zip(rows, panels, strict=True):
        _set_view(axes_of_row[0], row)
        for joint, axes in enumerate(axes_of_row):
            _draw(axes, row, joint, time)
        axes_of_row[0].set_ylabel(row.label)
    for joint in range(joints):
        panels[0, joint].set_title(f"joint {joint + 1}")
        panels[-1, joint].set_xlabel("time [ms]")
    panels[0, 0].set_xlim(time[0], time[-1])
    figure.suptitle(f"{title};  {method_name(motion.method)};  {time[-1]:.1f} ms", x=0.01, ha="left", fontsize=10)
    handles = [Line2D([], [], color=colour, label=f"{axis} axis") for axis, colour in (("q", BLUE), ("d", ORANGE))]
    handles.append(Line2D([], [], color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)), label="limit"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _rows(motion: Trajectory, limits: MotionLimits) -> list[_Row]:
    def one(name: str) -> tuple[_Line, ...]:
        return (_Line(np.array(getattr(motion, name)), INK, ""),)

    def both(d: str, q: str) -> tuple[_Line, ...]:
        return (_Line(np.array(getattr(motion, d)), ORANGE, "d"), _Line(np.array(getattr(motion, q)), BLUE, "q"))

    def magnitude(label: str, lines: tuple[_Line, ...], limit: npt.NDArray[np.float64], steps: bool = False) -> _Row:
        return _Row(label, lines, -limit, limit, steps)

    held = motion.control.kind == HELD
    return [
        _Row("position\n[rad]", one("joint_position_rad"), limits.joint_lower, limits.joint_upper, steps=False),
        magnitude("joint speed\n[rad/s]", one("joint_speed_rad_s"), limits.joint_speed),
        magnitude("joint torque\n[N m]", one("joint_torque_Nm"), limits.joint_torque),
        magnitude("current\n[A]", both("current_d_A", "current_q_A"), limits.current),
        magnitude("voltage\n[V]", both("voltage_d_V", "voltage_q_V"), limits.voltage, steps=held),
    ]


def _set_view(axes: Axes, row: _Row) -> None:
    """All limits in view when the motion comes near any of them, else the motion alone."""
    values = np.array([line.values for line in row.lines])
    low, high = values.min(), values.max()
    limit = np.nanmax(np.abs([row.low, row.high])) if np.isfinite([row.low, row.high]).any() else np.nan
    if max(abs(low), abs(high)) > 0.5 * limit:
        axes.set_ylim(-HEADROOM * limit, HEADROOM * limit)
    else:
        room = (HEADROOM - 1) * (high - low or 1.0)
        axes.set_ylim(low - room, high + room)


def _draw(axes: Axes, row: _Row, joint: int, time: npt.NDArray[np.float64]) -> None:
    for line in row.lines:
        style = "steps-pre" if row.steps else "default"
        axes.plot(time, line.values[:, joint], color=line.colour, drawstyle=style)
    low, high = float(row.low[joint]), float(row.high[joint])
    light_grid(axes)
    if not np.isfinite([low, high]).all():
        return
    shade_outside(axes, low, high)
    bottom, top = axes.get_ylim()
    if not (bottom <= low and high <= top):
        note = f"limit ±{high:.3g}" if low == -high else f"limits {low:.3g}, {high:.3g}".replace("-", "−")
        place: dict[str, Any] = {"xycoords": "axes fraction", "ha": "right", "va": "top"}
        box = {"facecolor": "white", "edgecolor": "none", "pad": 1, "alpha": 0.8}
        axes.annotate(note, (0.97, 0.95), **place, fontsize=6.5, color=QUIET, bbox=box)
