"""What looks wrong in an arm's numbers. None of it is refused: the dynamics are what the file says."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from services.codesign.robot import Robot

SMALLEST_SIZE = 0.1
"""A link is at least this long [m] when its inertia is judged: joints of a wrist may meet in one point."""
LONGEST_REACH, SHORTEST_REACH = 10.0, 0.02
"""Reach [m] beyond which lengths look like millimetres, and below which like kilometres."""
HEAVIEST = 1000.0
"""Mass of a link [kg] beyond which it looks like grams."""
WIDEST_RANGE = 4 * np.pi
"""Range of a joint [rad] beyond which it looks like degrees."""
SMALLEST_GEAR, LARGEST_GEAR = 5.0, 1000.0
ROUNDING = 1e-3
"""Share by which figures of three digits may break an inequality."""


@dataclass(frozen=True)
class Finding:
    """One thing that looks wrong."""

    where: str  # a joint or link
    what: str
    value: str
    limit: str


def link_points(robot: Robot, k: int) -> np.ndarray:
    """Where link k begins and ends at home: its joint's motor, and the next one's or the tool; shape (2, 3), m."""
    end = robot.motor_position[k + 1] if k + 1 < robot.joints else robot.tool_home[:3, 3]
    return np.array([robot.motor_position[k], end])


def link_lengths(robot: Robot) -> np.ndarray:
    """Distance from the beginning of each link to its end, shape (n,), m."""
    return np.array([np.linalg.norm(np.diff(link_points(robot, k), axis=0)) for k in range(robot.joints)])


def reach(robot: Robot) -> float:
    """Sum of the links' lengths [m]: the tool comes no further from joint 1."""
    return float(link_lengths(robot).sum())


def gyration_radii(robot: Robot) -> np.ndarray:
    """sqrt(largest principal moment / mass) of each link, shape (n,), m; NaN without mass."""
    largest = np.array([np.linalg.eigvalsh(inertia).max() for inertia in robot.link_inertia])
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(robot.link_mass > 0, np.sqrt(largest / robot.link_mass), np.nan)


def check_robot(robot: Robot) -> list[Finding]:
    """Everything that looks wrong, joint by joint, then of the whole arm."""
    found = [finding for k in range(robot.joints) for finding in (*_link(robot, k), *_joint(robot, k))]
    return [*found, *_whole(robot)]


def _link(robot: Robot, k: int) -> Iterator[Finding]:
    where, mass = f"link {k + 1}", float(robot.link_mass[k])
    moments = np.linalg.eigvalsh(robot.link_inertia[k])
    shown = f"{', '.join(f'{moment:.4g}' for moment in moments)} kg m2"
    if mass == 0:
        yield Finding(where, "has no mass", "0 kg", "above 0")
    if mass > HEAVIEST:
        yield Finding(where, "mass looks like grams", f"{mass:g} kg", f"at most {HEAVIEST:g} kg")
    if moments[0] <= 0:
        yield Finding(where, "inertia is not positive definite", shown, "every principal moment above 0")
    if moments[2] > (moments[0] + moments[1]) * (1 + ROUNDING):
        limit = f"the largest at most the sum of the others, {moments[0] + moments[1]:.4g}"
        yield Finding(where, "no body has such principal moments", shown, limit)
    points = link_points(robot, k)
    size = max(float(np.linalg.norm(points[1] - points[0])), SMALLEST_SIZE)
    radius = gyration_radii(robot)[k]
    if radius > size:
        yield Finding(where, "gyration radius larger than the link", f"{radius:.3g} m", f"at most {size:.3g} m")
    centre = robot.link_com_home[k][:3, 3]
    away = float(np.linalg.norm(points - centre, axis=1).min())
    if mass > 0 and away > 2 * size:
        yield Finding(
            where, "centre of mass far from the link", f"{away:.3g} m", f"within {2 * size:.3g} m of its ends"
        )


def _joint(robot: Robot, k: int) -> Iterator[Finding]:
    where, gear = f"joint {k + 1}", abs(float(robot.gear_ratio[k]))
    width = float(robot.joint_upper[k] - robot.joint_lower[k])
    if width > WIDEST_RANGE * (1 + ROUNDING):
        yield Finding(where, "range looks like degrees", f"{width:.4g} rad wide", f"at most {WIDEST_RANGE:.4g} rad")
    if gear < SMALLEST_GEAR:
        yield Finding(where, "almost no gear", f"{gear:g}", f"at least {SMALLEST_GEAR:g} turns of the rotor")
    if gear > LARGEST_GEAR:
        yield Finding(where, "very large gear ratio", f"{gear:g}", f"at most {LARGEST_GEAR:g}")


def _whole(robot: Robot) -> Iterator[Finding]:
    length = reach(robot)
    if length > LONGEST_REACH:
        yield Finding("arm", "lengths look like millimetres", f"reach {length:.4g} m", f"at most {LONGEST_REACH:g} m")
    if length < SHORTEST_REACH:
        yield Finding("arm", "is very short", f"reach {length:.4g} m", f"at least {SHORTEST_REACH:g} m")
    gravity = float(np.linalg.norm(robot.gravity))
    if not 0.5 * 9.81 < gravity < 1.5 * 9.81 and gravity != 0:
        yield Finding("arm", "unusual gravity", f"{gravity:.4g} m/s2", "9.81 m/s2 on Earth, or 0")
