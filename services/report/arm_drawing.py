"""An arm at home, seen from three sides: links, motors with their axes, centres of mass, tool."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from services.codesign.robot import Robot
from services.report.style import BLUE, INK, ORANGE, QUIET, RED, light_grid

VIEWS: Final = (("front", 1, 2), ("side", 0, 2), ("top", 0, 1))
"""Name of a view, and the space axes that it shows, right and up."""
AXIS_SHARE = 0.06
"""Length of a drawn joint axis, as a share of the arm's size."""


def arm_drawing(robot: Robot) -> Figure:
    """Three orthographic views to one scale, lengths in m."""
    figure = Figure(figsize=(10.5, 4.2), layout="constrained")
    for axes, (name, right, up) in zip(figure.subplots(1, 3), VIEWS, strict=True):
        _view(axes, robot, right, up)
        axes.set_title(name)
        axes.set_xlabel(f"{'xyz'[right]} [m]")
        axes.set_ylabel(f"{'xyz'[up]} [m]")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    figure.suptitle(f"{robot.name}: home, {robot.joints} joints")
    return figure


def _view(axes: Axes, robot: Robot, right: int, up: int) -> None:
    plane = [right, up]
    tool, centres = robot.tool_home[:3, 3], robot.link_com_home[:, :3, 3]
    path = np.vstack([np.zeros(3), robot.motor_position, tool])
    size = max(float(np.ptp(path, axis=0).max()), 1e-3)
    axes.plot(*path[:, plane].T, color=INK, linewidth=2, label="links")
    for k, (position, axis) in enumerate(zip(robot.motor_position, robot.joint_axes, strict=True)):
        ends = position + np.outer([-1, 1], axis) * size * AXIS_SHARE
        axes.plot(*ends[:, plane].T, color=BLUE, linewidth=3, label="joint axes, at the motors" if k == 0 else None)
        axes.annotate(str(k + 1), position[plane], textcoords="offset points", xytext=(6, 4), color=BLUE)
    heaviest = max(float(robot.link_mass.max()), 1e-9)
    area = 20 + 120 * robot.link_mass / heaviest
    axes.scatter(
        centres[:, right], centres[:, up], area, color=ORANGE, alpha=0.7, label="centres of mass, area by mass"
    )
    axes.plot(*tool[plane], "s", color=RED, label="payload")
    axes.plot(0, 0, "^", color=QUIET, markersize=9)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.15)
    light_grid(axes, "both")
