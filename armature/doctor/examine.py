"""Whether this machine and its settings can run the service, finding by finding, each with what to do."""

from __future__ import annotations

from collections.abc import Iterator

from armature.doctor.finding import Finding, Level
from armature.doctor.machine import compiler, cores, disk, kernel_cache, memory
from armature.doctor.solver import trial_solve, versions
from armature.doctor.stores import broker, database
from shared.settings import Settings


def examine(settings: Settings, *, with_solve: bool = True) -> Iterator[Finding]:
    """Look at everything, in the order in which it matters; each finding comes as soon as it is made.

    Nothing is changed but that the test solve compiles kernels that are missing.
    """
    yield versions()
    yield compiler()
    yield kernel_cache(settings)
    yield database(settings)
    yield broker(settings)
    yield cores(settings)
    yield memory(settings)
    yield disk(settings)
    if with_solve:
        yield trial_solve(settings)


def healthy(findings: list[Finding]) -> bool:
    """Whether the service can run, if perhaps slowly."""
    return all(finding.level is not Level.FAIL for finding in findings)
