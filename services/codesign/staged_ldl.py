"""The factorisation of `staged_ldl.c`, compiled for this machine and handed to IPOPT in MA27's place.

IPOPT loads the library itself (option `hsllib`) and calls it at every iteration; Python only says beforehand in which
order to eliminate. The library is one per process, and so is the order: one solve at a time, as for MUMPS.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import json
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from services.codesign.elimination import Elimination
from services.codesign.kernels import build_once, default_cache, processor, run_compiler

SOURCE = Path(__file__).with_suffix(".c")

COMPILER_FLAGS = ("-O3", "-march=native", "-ffp-contract=fast", "-fno-math-errno", "-fopenmp-simd", "-pthread")
"""The loops are written for vectors: -march=native gives the widest that this machine has."""

PIVOT_THRESHOLD = 1e-4
"""Entries of L stay below its inverse. IPOPT raises it when a solution is not accurate enough."""

PIVOT_THRESHOLD_MAX = 0.1


@dataclass(frozen=True)
class StagedLDL:
    """The library, loaded."""

    path: Path
    library: ctypes.CDLL

    def hand_over(self, elimination: Elimination, threads: int = 1) -> None:
        """Give the order in which the systems that follow are eliminated, and how many threads do it."""
        arrays = (elimination.order, elimination.first, elimination.pairs, elimination.chains)
        pointers = [np.ascontiguousarray(array, dtype=np.int32) for array in arrays]
        failed = self.library.staged_ldl_order(
            len(elimination.order),
            len(elimination.pairs),
            len(elimination.chains),
            len(elimination.order) - elimination.multipliers,
            *(array.ctypes.data_as(ctypes.c_void_p) for array in pointers),
            threads,
        )
        if failed:
            raise MemoryError("no memory for the order of elimination")

    @property
    def refused(self) -> bool:
        """Whether a system came since that the order does not fit. IPOPT may call that a failed restoration."""
        return bool(self.library.staged_ldl_refused())

    @property
    def ipopt_options(self) -> dict[str, Any]:
        """What makes IPOPT use it."""
        return {
            "linear_solver": "ma27",
            "hsllib": str(self.path),
            "linear_system_scaling": "none",  # its default for MA27 would want a routine of HSL
            "ma27_pivtol": PIVOT_THRESHOLD,
            "ma27_pivtolmax": PIVOT_THRESHOLD_MAX,
            "ma27_la_init_factor": 1.0,  # the sizes asked for are not estimates
            "ma27_liw_init_factor": 1.0,
        }


_LOADED: dict[Path, StagedLDL] = {}


def load_staged_ldl(cache: Path | None = None) -> StagedLDL | None:
    """The library, compiled now unless the cache holds it; None where there is no compiler. Kept per process."""
    path = (default_cache() if cache is None else cache) / f"{library_name()}.so"
    if path not in _LOADED:
        if not build_once(path, lambda compiler: _compile(compiler, path)):
            return None
        _LOADED[path] = StagedLDL(path, ctypes.CDLL(str(path)))
    return _LOADED[path]


def library_name() -> str:
    """Name under which the library is kept: it changes with the source, the flags and the processor."""
    return _name(SOURCE, COMPILER_FLAGS, tuple(processor()))


@functools.cache
def _name(source: Path, *shape: tuple[str, ...]) -> str:
    return "staged-ldl-" + hashlib.sha256(json.dumps([_text(source), *shape]).encode()).hexdigest()[:32]


@functools.cache
def _text(source: Path) -> str:
    """As it was when it was read first: no solve waits for it again, and what is compiled is what the name is of."""
    return source.read_text()


def _compile(compiler: str, path: Path) -> None:
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        source, built = f"{folder}/staged_ldl.c", f"{folder}/staged_ldl.so"
        Path(source).write_text(_text(SOURCE))
        run_compiler([compiler, *COMPILER_FLAGS, "-fPIC", "-shared", source, "-o", built, "-lm"])
        os.replace(built, path)
