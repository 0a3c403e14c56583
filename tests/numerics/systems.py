"""Systems by their entries, and what has to be true of their factorisation, by numpy."""

from __future__ import annotations

import numpy as np

from services.codesign.elimination import Elimination
from tests.numerics.ma27 import MA27

BACKWARD = 1e-11
"""Residual over |A| |x|: rounding, times a growth of 1e4 that the pivot threshold allows."""

Entries = tuple[np.ndarray, np.ndarray, np.ndarray]


def dense(size: int, entries: Entries) -> np.ndarray:
    rows, columns, values = entries
    matrix = np.zeros((size, size))
    np.add.at(matrix, (rows, columns), values)
    return matrix + matrix.T - np.diag(matrix.diagonal())


def check(order: Elimination, size: int, entries: Entries, threads: int = 1) -> MA27:
    """Factorise and solve: the inertia is numpy's, the solution solves."""
    ma27, matrix = MA27(order, size, *entries[:2], threads=threads), dense(size, entries)
    assert ma27.status == 0
    values = np.linalg.eigvalsh(matrix)
    for _ in range(2):  # the second time with the plan of the first
        assert ma27.factorise(entries[2]) == (0, int((values < 0).sum()))
        rhs = np.random.default_rng(1).normal(size=size)
        x = ma27.solve(rhs)
        assert np.abs(matrix @ x - rhs).max() <= BACKWARD * np.abs(matrix).max() * np.abs(x).max()
    return ma27


def lower_entries(matrix: np.ndarray) -> Entries:
    rows, columns = np.nonzero(np.tril(matrix))
    return rows, columns, matrix[rows, columns]


def check_early_end(order: Elimination, size: int, entries: Entries) -> None:
    """IPOPT gets the same answer as from the whole factorisation: as many negative eigenvalues, or too many."""
    negative = int((np.linalg.eigvalsh(dense(size, entries)) < 0).sum())
    status, found = MA27(order, size, *entries[:2], threads=2).factorise(entries[2])
    assert status == 0
    assert found == negative if negative <= order.multipliers else found > order.multipliers


def order_of(sizes: list[int], pairs: list[int] | None = None, chains: tuple[int, ...] = (0,)) -> Elimination:
    first = np.concatenate([[0], np.cumsum(sizes)])
    return Elimination(np.arange(first[-1]), first, np.array(pairs or [0] * len(sizes)), np.array(chains))
