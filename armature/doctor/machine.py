"""The machine: compiler, room for compiled kernels, cores, memory, disk."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

from armature.doctor.finding import Finding, fail, ok, warn
from shared.settings import Settings

GET_A_COMPILER = (
    "install one (gcc or clang; on Debian: apt install gcc libc6-dev), or name it in CC; without, solves take about "
    "thirty times longer"
)
TRIAL = "#include <math.h>\ndouble trial(double x) { return sin(x); }\n"
"""Needs what the kernels need: the C library's headers, and a linker."""

MB, GB = 1e6, 1e9
WORKER_BYTES = 300 * MB
"""Of one solver process: 150 MB for one task, more for a shared optimum of many."""
REST_BYTES = 400 * MB
"""API, relay, and the worker's parent."""
LITTLE_DISK_BYTES, NO_DISK_BYTES = 2 * GB, 200 * MB


def compiler() -> Finding:
    """Whether a C file can be compiled, as kernels are."""
    from services.codesign.kernels import COMPILER_FLAGS, LANES_FLAGS, build_once, run_compiler

    used = []
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "trial.c"
        source.write_text(TRIAL, encoding="utf-8")

        def build(path: str) -> None:
            used.append(path)
            run_compiler([path, *COMPILER_FLAGS, *LANES_FLAGS, str(source), "-o", f"{folder}/trial.so", "-lm"])

        try:
            if not build_once(Path(folder) / "trial.so", build):
                return warn("compiler", "none: neither $CC, nor cc, gcc, clang", GET_A_COMPILER)
        except (OSError, RuntimeError) as error:
            lines = str(error).splitlines()
            said = next((line for line in lines if "error" in line), lines[-1])
            return fail("compiler", f"{used[0]} cannot compile a C file: {said}", GET_A_COMPILER)
    return ok("compiler", used[0])


def kernel_cache(settings: Settings) -> Finding:
    """Whether compiled kernels can be kept, and how many there are."""
    folder = settings.kernel_cache
    place = _existing(folder)
    if not os.access(place, os.W_OK):
        return fail("kernels", f"{place} cannot be written to", "set ARMATURE_HOME to a folder of yours")
    libraries = list(folder.glob("*.so"))
    size = sum(path.stat().st_size for path in libraries)
    return ok("kernels", f"{len(libraries)} compiled libraries, {size / MB:.0f} MB, in {folder}")


def cores(settings: Settings) -> Finding:
    """Processors that this process may use, against the solver processes that are asked for."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    found = f"{count}, for {settings.workers} solver processes"
    if settings.workers > count:
        return warn("cores", found, f"set ARMATURE_WORKERS={count}: more processes than cores only slow each other")
    return ok("cores", found)


def memory(settings: Settings) -> Finding:
    """Memory that is free now, against what API and solver processes take."""
    total = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    free = _available_bytes()
    needed = REST_BYTES + settings.workers * WORKER_BYTES
    found = f"{total / GB:.1f} GB" if free is None else f"{free / GB:.1f} of {total / GB:.1f} GB available"
    if (total if free is None else free) < needed:
        advice = (
            f"{settings.workers} solver processes and the API take about {needed / GB:.1f} GB: lower ARMATURE_WORKERS"
        )
        return warn("memory", found, advice)
    return ok("memory", found)


def disk(settings: Settings) -> Finding:
    """Room where the database, the broker and the kernels are kept."""
    place = _existing(settings.home)
    free = shutil.disk_usage(place).free
    found = f"{free / GB:.1f} GB free in {place}"
    advice = "make room, or set ARMATURE_HOME to a folder on a larger disk; ARMATURE_RETENTION_DAYS deletes old results"
    if free < NO_DISK_BYTES:
        return fail("disk", found, advice)
    return warn("disk", found, advice) if free < LITTLE_DISK_BYTES else ok("disk", found)


def _existing(folder: Path) -> Path:
    """The folder, or the nearest one above it that is there."""
    return next(place for place in (folder, *folder.parents) if place.exists())


def _available_bytes() -> int | None:
    """Memory that can be had without swapping; None where the system does not say (macOS)."""
    info = Path("/proc/meminfo")
    if not info.exists():
        return None
    lines = dict(line.split(":", 1) for line in info.read_text(encoding="ascii").splitlines())
    return int(lines["MemAvailable"].split()[0]) * 1024 if "MemAvailable" in lines else None
