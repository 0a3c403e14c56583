"""The staged factorisation as IPOPT calls it: by MA27's names, with arrays of the sizes that it asks for."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from services.codesign.elimination import Elimination
from services.codesign.staged_ldl import PIVOT_THRESHOLD, StagedLDL, load_staged_ldl

NO_INTEGER_SPACE, NO_REAL_SPACE, SINGULAR, WRONG_SIZE = -3, -4, -5, -1


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)


def _number(value: int) -> Any:
    return ctypes.byref(ctypes.c_int(value))


class MA27:
    """One matrix pattern: lower or upper entries (rows, columns), entries at the same place add up."""

    def __init__(
        self, order: Elimination, size: int, rows: np.ndarray, columns: np.ndarray, *, threads: int = 1
    ) -> None:
        loaded = load_staged_ldl()
        assert isinstance(loaded, StagedLDL)
        loaded.hand_over(order, threads)
        self.library, self.size, self.entries = loaded.library, size, len(rows)
        self.irn, self.icn = (np.asarray(part, dtype=np.int32) + 1 for part in (rows, columns))
        self.icntl, self.cntl, self.info = np.zeros(30, np.int32), np.zeros(5), np.zeros(20, np.int32)
        self.library.ma27id_(_pointer(self.icntl), _pointer(self.cntl))
        self.cntl[0] = PIVOT_THRESHOLD
        self.ikeep, self.iw1 = np.zeros(3 * size, np.int32), np.zeros(2 * size, np.int32)
        self.nsteps, self.maxfrt = ctypes.c_int(0), ctypes.c_int(0)
        iw, operations = np.zeros(4 * self.entries + 4 * size, np.int32), ctypes.c_double(0)
        self.library.ma27ad_(
            *self._pattern(), _pointer(iw), _number(len(iw)), _pointer(self.ikeep), _pointer(self.iw1),
            ctypes.byref(self.nsteps), _number(0), _pointer(self.icntl), _pointer(self.cntl), _pointer(self.info),
            ctypes.byref(operations),
        )  # fmt: skip
        self.status = int(self.info[0])
        self.allocate(int(self.info[4]), int(self.info[5]))

    def _pattern(self) -> tuple[Any, ...]:
        return _number(self.size), _number(self.entries), _pointer(self.irn), _pointer(self.icn)

    def allocate(self, reals: int, integers: int) -> None:
        """Arrays full of rubbish, as from malloc."""
        self.a, self.iw = np.full(reals, np.nan), np.full(integers, -7, np.int32)

    def factorise(self, values: np.ndarray) -> tuple[int, int]:
        """INFO(1), and the number of negative eigenvalues."""
        self.a[: self.entries] = values
        self.library.ma27bd_(
            *self._pattern(), _pointer(self.a), _number(len(self.a)), _pointer(self.iw), _number(len(self.iw)),
            _pointer(self.ikeep), ctypes.byref(self.nsteps), ctypes.byref(self.maxfrt), _pointer(self.iw1),
            _pointer(self.icntl), _pointer(self.cntl), _pointer(self.info),
        )  # fmt: skip
        return int(self.info[0]), int(self.info[14])

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        x, work = rhs.astype(float), np.full(self.maxfrt.value, np.nan)
        self.library.ma27cd_(
            _number(self.size), _pointer(self.a), _number(len(self.a)), _pointer(self.iw), _number(len(self.iw)),
            _pointer(work), ctypes.byref(self.maxfrt), _pointer(x), _pointer(self.iw1), ctypes.byref(self.nsteps),
            _pointer(self.icntl), _pointer(self.cntl),
        )  # fmt: skip
        return x
