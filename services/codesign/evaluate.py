"""Calls of small CasADi functions on numpy's arrays, without CasADi's own matrices in between: these take longer to
make than such a function to evaluate."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np


def evaluate(function: ca.Function, *arguments: np.ndarray) -> list[np.ndarray]:
    """Outputs of a function whose inputs and outputs are dense, each in its own shape.

    Raises
    ------
    ValueError
        For an argument of another size than the input, or a function with sparse ones.
    RuntimeError
        When the evaluation fails.
    """
    patterns = [function.sparsity_in(i) for i in range(function.n_in())]
    if not all(
        pattern.is_dense() for pattern in patterns + [function.sparsity_out(i) for i in range(function.n_out())]
    ):
        raise ValueError(f"{function.name()} has inputs or outputs that are sparse")
    into: list[Any] = [np.asarray(argument, dtype=float).ravel(order="F") for argument in arguments]
    sizes = [pattern.numel() for pattern in patterns]
    if [len(argument) for argument in into] != sizes:
        raise ValueError(f"{function.name()} takes {sizes} numbers, not {[len(argument) for argument in into]}")
    out: list[Any] = [np.empty(function.size_out(i), order="F") for i in range(function.n_out())]
    buffer: Any
    buffer, call = function.buffer()
    for i, argument in enumerate(into):
        buffer.set_arg(i, memoryview(argument))
    for i, result in enumerate(out):
        buffer.set_res(i, memoryview(result.ravel(order="K")))
    call()
    if buffer.ret():
        raise RuntimeError(f"{function.name()} could not be evaluated")
    return out
