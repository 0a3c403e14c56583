"""URDFs to test with: random trees without any symmetry."""

from __future__ import annotations

import numpy as np


def inertial(rng: np.random.Generator) -> str:
    """Origin with rpy, mass, and a full inertia that a body can have."""
    points = rng.normal(size=(6, 3)) * 0.1
    C = points.T @ points
    inertia = np.trace(C) * np.eye(3) - C
    xyz, rpy = rng.uniform(-0.3, 0.3, 3), rng.uniform(-3, 3, 3)
    moments = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    attributes = " ".join(f'{name}="{float(inertia[place])!r}"' for name, place in moments.items())
    return (
        f'<inertial><origin xyz="{text(xyz)}" rpy="{text(rpy)}"/><mass value="{float(rng.uniform(0.2, 5))!r}"/>'
        f"<inertia {attributes}/></inertial>"
    )


def text(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)


def joint(name: str, kind: str, parent: str, child: str, rng: np.random.Generator, *more: str) -> str:
    axis = "" if kind == "fixed" else f'<axis xyz="{text(rng.normal(size=3))}"/>'
    limit = '<limit lower="-2.5" upper="2.5" effort="100" velocity="3"/>' if kind == "revolute" else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{text(rng.uniform(-0.4, 0.4, 3))}" rpy="{text(rng.uniform(-3, 3, 3))}"/>'
        f"{axis}{limit}{''.join(more)}</joint>"
    )


def link(name: str, rng: np.random.Generator) -> str:
    return f'<link name="{name}">{inertial(rng)}</link>'


def random_urdf(joints: int, seed: int = 0) -> str:
    """An arm of revolute joints; each of its links carries a box by a fixed joint, and the last one a flange."""
    rng = np.random.default_rng([joints, seed, 11])
    parts = [link("link0", rng)]
    for k in range(joints):
        parts += [link(f"link{k + 1}", rng), joint(f"joint{k + 1}", "revolute", f"link{k}", f"link{k + 1}", rng)]
        parts += [link(f"box{k + 1}", rng), joint(f"bolt{k + 1}", "fixed", f"link{k + 1}", f"box{k + 1}", rng)]
    parts += [link("flange", rng), joint("plate", "fixed", f"box{joints}", "flange", rng)]
    return robot(*parts)


def robot(*parts: str, name: str = "arm") -> str:
    return f'<?xml version="1.0"?><robot name="{name}">{"".join(parts)}</robot>'
