"""Versions of what shapes a number, stored with every application."""

from __future__ import annotations

import platform
from functools import lru_cache
from importlib.metadata import version


@lru_cache(maxsize=1)
def versions() -> dict[str, str]:
    """Package versions by name."""
    packages = {"armature": "armature-codesign", "casadi": "casadi", "numpy": "numpy"}
    return {name: version(package) for name, package in packages.items()} | {"python": platform.python_version()}
