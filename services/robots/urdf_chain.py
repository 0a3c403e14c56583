"""From a URDF's tree to a serial arm: the chain between two links, and its bodies at home (all joints at zero)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from services.codesign.robot import RobotError
from services.robots.urdf_document import UrdfDocument, UrdfJoint, UrdfLink, quoted_names

TURNING = ("revolute", "continuous")


@dataclass(frozen=True)
class Body:
    """Links that move as one; poses are in the space frame, that of the base link."""

    links: tuple[str, ...]
    mass: float  # kg
    centre: np.ndarray  # (3,) m
    inertia: np.ndarray  # (3, 3) kg m2 about the centre, in the axes of the space frame


@dataclass(frozen=True)
class Chain:
    """A serial arm of n joints in a URDF."""

    base: str
    tip: str
    joints: tuple[UrdfJoint, ...]  # n, from base to tip
    bodies: tuple[Body, ...]  # n, moved by the joint of the same number
    base_links: tuple[str, ...]  # what does not move
    held: tuple[str, ...]  # joints that could move but are not on the chain: held at zero
    rotations: dict[str, np.ndarray]  # (3, 3) of every link's frame at home
    positions: dict[str, np.ndarray]  # (3,) m

    def carriers(self, k: int) -> tuple[str, ...]:
        """Links of the body that joint k turns against: those that can carry its motor."""
        return self.base_links if k == 0 else self.bodies[k - 1].links


def find_chain(document: UrdfDocument, base_link: str | None = None, tip_link: str | None = None) -> Chain:
    """The arm between two links.

    Links joined by fixed joints are one body, and so is what hangs on a link of the arm by joints that are not on the
    chain: those are held at zero.

    Parameters
    ----------
    base_link
        Default: the one link that no joint moves.
    tip_link
        Default: where the tree ends, when it does not branch.

    Raises
    ------
    RobotError
        When the choice is open, a joint on the chain does not turn, or nothing turns.
    """
    base = base_link if base_link is not None else _root(document)
    for field, link in (("base_link", base), ("tip_link", tip_link)):
        if link is not None and link not in document.links:
            raise RobotError(field, f"there is no link {link!r}; links are {quoted_names(list(document.links)[:20])}")
    children = _children(document)
    order = _reach(base, children)
    tip = tip_link if tip_link is not None else _only_leaf(base, order, children)
    joints = _path(document, base, tip)
    _check_kinds(joints)
    on_chain = {joint.name for joint in joints}
    rotations, positions = _home_poses(base, order)
    behind = {start: _reach(start, children, without=on_chain) for start in (base, *(joint.child for joint in joints))}
    base_links, *links = ((start, *(joint.child for joint in group)) for start, group in behind.items())
    return Chain(
        base=base,
        tip=tip,
        joints=joints,
        bodies=tuple(_body([document.links[name] for name in names], rotations, positions) for names in links),
        base_links=base_links,
        held=tuple(joint.name for group in behind.values() for joint in group if joint.kind != "fixed"),
        rotations=rotations,
        positions=positions,
    )


def _root(document: UrdfDocument) -> str:
    moved = {joint.child for joint in document.joints.values()}
    roots = [name for name in document.links if name not in moved]
    if len(roots) != 1:
        which = f"links without a parent are {quoted_names(roots[:10])}" if roots else "every link has a parent"
        raise RobotError("base_link", f"must be given: {which}")
    return roots[0]


def _children(document: UrdfDocument) -> dict[str, list[UrdfJoint]]:
    children: dict[str, list[UrdfJoint]] = {name: [] for name in document.links}
    for joint in document.joints.values():
        children[joint.parent].append(joint)
    return children


def _reach(start: str, children: dict[str, list[UrdfJoint]], without: Iterable[str] = ()) -> list[UrdfJoint]:
    """Joints behind a link, parents first. A link has one parent, so that a ring can only close at the start."""
    closed, waiting, found = set(without), [start], list[UrdfJoint]()
    while waiting:
        for joint in children[waiting.pop()]:
            if joint.name in closed:
                continue
            if joint.child == start:
                raise RobotError("urdf", f"joint {joint.name!r} closes a ring at link {start!r}")
            found.append(joint)
            waiting.append(joint.child)
    return found


def _only_leaf(base: str, order: list[UrdfJoint], children: dict[str, list[UrdfJoint]]) -> str:
    """The end of a tree that branches nowhere but in the base."""
    leaves = [name for name in (base, *(joint.child for joint in order)) if not children[name]]
    parents = {joint.child: joint for joint in order}
    moving = [leaf for leaf in leaves if _turns_above(leaf, parents)]
    if len(moving) != 1:
        choice = quoted_names((moving or leaves)[:20])
        what = f"the tree ends in {choice}" if moving else "no joint turns"
        raise RobotError("tip_link", f"must be given: {what}")
    return moving[0]


def _turns_above(link: str, parents: dict[str, UrdfJoint]) -> bool:
    while link in parents:
        if parents[link].kind != "fixed":
            return True
        link = parents[link].parent
    return False


def _path(document: UrdfDocument, base: str, tip: str) -> tuple[UrdfJoint, ...]:
    """Joints from base to tip that are not fixed."""
    above = {joint.child: joint for joint in document.joints.values()}
    path, link = list[UrdfJoint](), tip
    while link != base:
        if link not in above or len(path) > len(above):
            raise RobotError("tip_link", f"link {tip!r} does not hang on {base!r}")
        path.append(above[link])
        link = above[link].parent
    turning = tuple(joint for joint in reversed(path) if joint.kind != "fixed")
    if not turning:
        raise RobotError("tip_link", f"nothing turns between {base!r} and {tip!r}")
    return turning


def _check_kinds(joints: tuple[UrdfJoint, ...]) -> None:
    for joint in joints:
        if joint.kind not in TURNING:
            raise RobotError("urdf", f"joint {joint.name!r} is {joint.kind}: every joint of the arm must be revolute")
        if joint.mimics is not None:
            raise RobotError("urdf", f"joint {joint.name!r} mimics {joint.mimics!r}: every joint needs its own motor")


def _home_poses(base: str, order: list[UrdfJoint]) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    rotations, positions = {base: np.eye(3)}, {base: np.zeros(3)}
    for joint in order:
        R = rotations[joint.parent]
        rotations[joint.child] = R @ joint.rotation
        positions[joint.child] = positions[joint.parent] + R @ joint.position
    return rotations, positions


def _body(links: list[UrdfLink], rotations: dict[str, np.ndarray], positions: dict[str, np.ndarray]) -> Body:
    """Lump links by the parallel-axis theorem: I = sum R I_i R' + m_i (d'd 1 - d d'), d from the common centre."""
    masses = np.array([link.mass for link in links])
    centres = np.array([positions[link.name] + rotations[link.name] @ link.centre for link in links])
    mass = float(masses.sum())
    centre = masses @ centres / mass if mass > 0 else positions[links[0].name]
    inertia = np.zeros((3, 3))
    for link, m, d in zip(links, masses, centres - centre, strict=True):
        R = rotations[link.name]
        inertia += R @ link.inertia @ R.T + m * (d @ d * np.eye(3) - np.outer(d, d))
    return Body(tuple(link.name for link in links), mass, centre, inertia)
