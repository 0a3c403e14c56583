"""Read a URDF safely: only what says how an arm moves and what it weighs.

The text is parsed without entities and without a document type. What is left of it, links' inertials and joints, is
copied into a tree of its own before the URDF parser sees it: no mesh, texture or plugin is ever looked at, and no file
is opened.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element, ParseError, SubElement, tostring

import numpy as np
from defusedxml import DefusedXmlException
from defusedxml.ElementTree import fromstring
from urdf_parser_py.urdf import URDF
from urdf_parser_py.xml_reflection.core import ParseError as UrdfParseError

from services.codesign.robot import TOLERANCE, RobotError

LARGEST_TEXT = 1_000_000
"""Characters of a URDF."""
MOST_ELEMENTS = 1000
"""Links, and joints, of a URDF."""
LARGEST_NUMBER = 1e6
"""Of any length, mass or inertia [SI]: nothing that a motor of 5 kg moves comes near it."""

_KEPT: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "link": {"inertial": ()},
    "joint": {
        "origin": ("xyz", "rpy"),
        "parent": ("link",),
        "child": ("link",),
        "axis": ("xyz",),
        "limit": ("lower", "upper", "effort", "velocity"),
        "dynamics": ("damping", "friction"),
        "mimic": ("joint", "multiplier", "offset"),
    },
    "inertial": {
        "origin": ("xyz", "rpy"),
        "mass": ("value",),
        "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    },
}


@dataclass(frozen=True)
class UrdfLink:
    """A link's inertia; poses are in the link's frame, units SI."""

    name: str
    mass: float
    centre: np.ndarray  # (3,) centre of mass
    inertia: np.ndarray  # (3, 3) about it, in the link's axes


@dataclass(frozen=True)
class UrdfJoint:
    """A joint; its pose is that of the child's frame in the parent's, at zero."""

    name: str
    kind: str
    parent: str
    child: str
    rotation: np.ndarray  # (3, 3)
    position: np.ndarray  # (3,) m
    axis: np.ndarray  # (3,) unit, in the child's frame
    lower: float | None  # rad
    upper: float | None
    speed: float | None  # rad/s
    damping: float  # N m s/rad
    friction: float  # N m
    mimics: str | None


@dataclass(frozen=True)
class UrdfDocument:
    """Links and joints by name; the joints form trees."""

    name: str
    links: dict[str, UrdfLink]
    joints: dict[str, UrdfJoint]


def read_urdf(text: str) -> UrdfDocument:
    """Parse a URDF.

    Raises
    ------
    RobotError
        With field `urdf`: what is wrong, at which link or joint.
    """
    cleaned = tostring(_cleaned(_parsed(text)))
    try:
        parsed = URDF.from_xml_string(cleaned)
    except UrdfParseError as error:
        raise _refusal(" ".join(str(error).split())) from error
    except (AssertionError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise _refusal(f"not a URDF: {str(error) or type(error).__name__}") from error
    links = {link.name: _link(link) for link in parsed.links}
    joints = {joint.name: _joint(joint) for joint in parsed.joints}
    _check_tree(links, joints)
    return UrdfDocument(parsed.name, links, joints)


def _refusal(reason: str) -> RobotError:
    return RobotError("urdf", reason)


def _parsed(text: str) -> Element:
    if "<" not in text:
        raise _refusal("must be the text of a URDF; the command line and the client put it in place of a file's name")
    if len(text) > LARGEST_TEXT:
        raise _refusal(f"{len(text)} characters: at most {LARGEST_TEXT}")
    try:
        root: Element = fromstring(text.encode(), forbid_dtd=True)
    except DefusedXmlException as error:
        raise _refusal("must have no document type and no entities") from error
    except (ParseError, ValueError, LookupError) as error:  # an encoding that does not exist is a LookupError
        raise _refusal(f"not XML: {error}") from error
    if root.tag != "robot":
        raise _refusal(
            f"the outermost element is {str(root.tag)[:60]!r}, not 'robot' (a xacro has to be expanded first)"
        )
    return root


def _cleaned(root: Element) -> Element:
    """A tree of the known elements alone."""
    kept = Element("robot", {"name": root.get("name", "robot")})
    for tag in ("link", "joint"):
        elements = root.findall(tag)
        if len(elements) > MOST_ELEMENTS:
            raise _refusal(f"{len(elements)} {tag}s: at most {MOST_ELEMENTS}")
        seen: set[str] = set()
        for element in elements:
            name = element.get("name", "")
            if not name or name in seen:
                raise _refusal(f"every {tag} needs a name of its own, not {name!r}")
            seen.add(name)
            attributes = {"name": name} | ({"type": element.get("type", "")} if tag == "joint" else {})
            _copy(element, SubElement(kept, tag, attributes), f"{tag} {name!r}")
    return kept


def _copy(source: Element, target: Element, where: str) -> None:
    for tag, names in _KEPT[source.tag].items():
        found = source.findall(tag)
        if len(found) > 1:
            raise _refusal(f"{where}: {len(found)} elements <{tag}>, at most one")
        for element in found:
            attributes = {name: element.attrib[name] for name in names if name in element.attrib}
            if tag == "limit":
                attributes = {"effort": "0", "velocity": "0"} | attributes
            child = SubElement(target, tag, attributes)
            if tag in _KEPT:
                _copy(element, child, where)


def _link(link: Any) -> UrdfLink:
    where, inertial = f"link {link.name!r}", link.inertial
    if inertial is None:
        return UrdfLink(link.name, 0.0, np.zeros(3), np.zeros((3, 3)))
    mass = float(_numbers(inertial.mass, f"{where}: mass"))
    if mass < 0:
        raise _refusal(f"{where}: mass {mass:g} kg must not be negative")
    inertia = np.zeros((3, 3))
    if inertial.inertia is not None:
        inertia = _numbers(inertial.inertia.to_matrix(), f"{where}: inertia")
    lowest, size = np.linalg.eigvalsh(inertia).min(), np.abs(inertia).max()
    if lowest < -TOLERANCE * size:
        raise _refusal(f"{where}: inertia has a principal moment of {lowest:.4g} kg m2, which must not be negative")
    R, centre = _pose(inertial.origin, where)
    return UrdfLink(link.name, mass, centre, R @ inertia @ R.T)


def _joint(joint: Any) -> UrdfJoint:
    where, limit, dynamics = f"joint {joint.name!r}", joint.limit, joint.dynamics
    R, p = _pose(joint.origin, where)
    axis = _numbers([1, 0, 0] if joint.axis is None else joint.axis, f"{where}: axis", (3,))
    length = float(np.linalg.norm(axis))
    if length < TOLERANCE and joint.type not in ("fixed", "floating"):
        raise _refusal(f"{where}: its axis has no direction")
    bounded = joint.type in ("revolute", "prismatic") and limit is not None
    lower, upper, speed, damping, friction = (
        float(_numbers(0.0 if value is None else value, f"{where}: {what}"))
        for value, what in (
            (limit and limit.lower, "lower limit"),
            (limit and limit.upper, "upper limit"),
            (limit and limit.velocity, "velocity limit"),
            (dynamics and dynamics.damping, "damping"),
            (dynamics and dynamics.friction, "friction"),
        )
    )
    return UrdfJoint(
        name=joint.name,
        kind=joint.type,
        parent=joint.parent,
        child=joint.child,
        rotation=R,
        position=p,
        axis=axis / length if length >= TOLERANCE else axis,
        lower=lower if bounded else None,
        upper=upper if bounded else None,
        speed=speed if speed > 0 else None,
        damping=damping,
        friction=friction,
        mimics=None if joint.mimic is None else joint.mimic.joint,
    )


def _pose(origin: Any, where: str) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and translation of an <origin>."""
    xyz = [0, 0, 0] if origin is None or origin.xyz is None else origin.xyz
    rpy = [0, 0, 0] if origin is None or origin.rpy is None else origin.rpy
    return rotation_of(_numbers(rpy, f"{where}: rpy", (3,))), _numbers(xyz, f"{where}: xyz", (3,))


def rotation_of(rpy: np.ndarray) -> np.ndarray:
    """R = Rz(yaw) Ry(pitch) Rx(roll), the URDF's fixed axes; `rpy` in rad."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _numbers(values: Any, where: str, shape: tuple[int, ...] | None = None) -> np.ndarray:
    array = np.array(values, dtype=float)
    if shape is not None and array.shape != shape:
        raise _refusal(f"{where} needs {shape[0]} numbers, not {array.size}")
    if not (np.abs(array) <= LARGEST_NUMBER).all():  # NaN compares false
        raise _refusal(f"{where} {array.tolist()}: every number must be finite, and within {LARGEST_NUMBER:g}")
    return array


def _check_tree(links: Mapping[str, UrdfLink], joints: Mapping[str, UrdfJoint]) -> None:
    """Every joint between two links that there are, no link with two parents."""
    if not links:
        raise _refusal("no links")
    moved: dict[str, str] = {}
    for joint in joints.values():
        for link in (joint.parent, joint.child):
            if link not in links:
                raise _refusal(f"joint {joint.name!r}: there is no link {link!r}")
        if joint.child in moved:
            raise _refusal(f"link {joint.child!r} has two parents, joints {moved[joint.child]!r} and {joint.name!r}")
        moved[joint.child] = joint.name


def quoted_names(names: Iterable[str]) -> str:
    """For messages."""
    return ", ".join(repr(name) for name in names)
