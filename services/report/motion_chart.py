"""One motion over time: positions, speeds, torques, currents and voltages of every joint, against their limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.cbook import pts_to_prestep
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from services.report.motion_limits import MotionLimits
from services.report.style import BLUE, FAINT, INK, ORANGE, OUTSIDE, QUIET, method_name
from shared.contracts.motions import Trajectory

COLUMN, ROW = 2.0, 1.45  # inches
GAP = 0.22  # inches between panels
LEFT, RIGHT, TOP, BOTTOM = 0.85, 0.15, 0.6, 0.72  # inches around them
NEXT = COLUMN / (COLUMN - GAP)
"""From one joint's panel to the next, in widths of a panel."""
MOST_TIMES, MOST_VALUES = 3, 5
"""Intervals between ticks."""
DASHES = (0, (4, 3))
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

    The panels of a row are one set of axes, joint k's from k NEXT to k NEXT + 1, with a share of the motion's time on
    each: axes for every panel, and finding places for them, take ten times as long.

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
    width, height = LEFT + COLUMN * joints - GAP + RIGHT, TOP + ROW * len(rows) - GAP + BOTTOM
    figure = Figure(figsize=(width, height))
    time = MS * np.array(motion.time_s)
    for position, row in enumerate(rows):
        bottom = BOTTOM + ROW * (len(rows) - 1 - position)
        box = (LEFT / width, bottom / height, (COLUMN * joints - GAP) / width, (ROW - GAP) / height)
        _draw_row(figure.add_axes(box), row, joints, (time - time[0]) / (time[-1] - time[0]))
    first, last = figure.axes[0], figure.axes[-1]
    for joint in range(joints):
        first.text(NEXT * joint, 1.06, f"joint {joint + 1}", transform=first.get_xaxis_transform(), fontsize=9.5)
    _write_times(last, time, joints)
    heading = f"{title};  {method_name(motion.method)};  {time[-1]:.1f} ms"
    figure.text(0.1 / width, 1 - 0.1 / height, heading, va="top", fontsize=10)
    handles = [Line2D([], [], color=colour, label=f"{axis} axis") for axis, colour in (("q", BLUE), ("d", ORANGE))]
    handles.append(Line2D([], [], color=QUIET, linewidth=0.8, linestyle=DASHES, label="limit"))
    figure.legend(handles=handles, loc="lower center", ncols=3)
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


def _draw_row(axes: Axes, row: _Row, joints: int, share: npt.NDArray[np.float64]) -> None:
    """One quantity of every joint, over the share of the motion's time, shape (points,), from 0 to 1."""
    _set_view(axes, row)
    axes.set_xlim(0, NEXT * (joints - 1) + 1)
    axes.spines[:].set_visible(False)
    axes.set_xticks([])
    axes.set_ylabel(row.label)
    low, high = axes.get_ylim()
    ticks = MaxNLocator(MOST_VALUES, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    axes.set_yticks([tick for tick in ticks if low <= tick <= high])
    starts = NEXT * np.arange(joints)
    levels = [[(start, tick), (start + 1, tick)] for start in starts for tick in axes.get_yticks()]
    axes.add_collection(LineCollection(levels, colors=FAINT, linewidths=0.6, zorder=0.5), autolim=False)
    frames = [[(start, 1), (start, 0), (start + 1, 0)] for start in starts]
    across = axes.get_xaxis_transform()
    whole: dict[str, Any] = {"transform": across, "clip_on": False}
    axes.add_collection(LineCollection(frames, colors=QUIET, linewidths=0.7, **whole), autolim=False)
    for line in row.lines:
        curves = [_curve(start + share, values, row.steps) for start, values in zip(starts, line.values.T, strict=True)]
        axes.add_collection(LineCollection(curves, colors=line.colour, linewidths=1.3, label=line.label), autolim=False)
    for start, lower, upper in zip(starts, row.low, row.high, strict=True):
        if np.isfinite([lower, upper]).all():
            _show_limits(axes, float(start), float(lower), float(upper))


def _curve(x: npt.NDArray[np.float64], y: npt.NDArray[np.float64], steps: bool) -> npt.NDArray[np.float64]:
    """Points of a line, shape (m, 2)."""
    return np.transpose(pts_to_prestep(x, y) if steps else (x, y))


def _show_limits(axes: Axes, start: float, lower: float, upper: float) -> None:
    """Grey what lies beyond, or say where the limits are when they are out of view."""
    bottom, top = axes.get_ylim()
    if not (bottom <= lower and upper <= top):
        note = f"limit ±{upper:.3g}" if lower == -upper else f"limits {lower:.3g}, {upper:.3g}".replace("-", "−")
        box = {"facecolor": "white", "edgecolor": "none", "pad": 1, "alpha": 0.8}
        place: dict[str, Any] = {"transform": axes.get_xaxis_transform(), "ha": "right", "va": "top"}
        axes.text(start + 0.97, 0.95, note, **place, fontsize=6.5, color=QUIET, bbox=box, zorder=0.8)
    for edge, end in ((lower, bottom), (upper, top)):
        if bottom <= edge <= top:
            beyond = Rectangle((start, edge), 1, end - edge, facecolor=OUTSIDE, edgecolor="none", zorder=0)
            axes.add_artist(beyond)
            axes.add_artist(Line2D([start, start + 1], [edge, edge], color=QUIET, linewidth=0.8, linestyle=DASHES))


def _write_times(axes: Axes, time: npt.NDArray[np.float64], joints: int) -> None:
    """Ticks below each joint's panel, in ms."""
    found = MaxNLocator(MOST_TIMES, steps=[1, 2, 5, 10]).tick_values(time[0], time[-1])
    ticks = [tick for tick in found if time[0] <= tick <= time[-1]]
    shares = (np.array(ticks) - time[0]) / (time[-1] - time[0])
    places = [NEXT * joint + share for joint in range(joints) for share in shares]
    axes.set_xticks(places, [f"{tick:g}" for tick in ticks] * joints)
    axes.set_xlabel("time [ms]")
