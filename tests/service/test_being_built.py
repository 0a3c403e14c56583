"""Whether kernels are being compiled, as progress displays ask."""

from __future__ import annotations

import fcntl
from pathlib import Path

from services.codesign.kernels import BUILD_LOCK_SUFFIX, being_built


def test_only_a_held_lock_counts(tmp_path: Path) -> None:
    """Locks are left behind by every build; a builder that died holds none."""
    assert not being_built(tmp_path / "no such folder")
    lock = tmp_path / f"abc{BUILD_LOCK_SUFFIX}"
    lock.touch()
    assert not being_built(tmp_path)
    with lock.open("w") as builder:
        fcntl.flock(builder, fcntl.LOCK_EX)
        assert being_built(tmp_path)
    assert not being_built(tmp_path)
