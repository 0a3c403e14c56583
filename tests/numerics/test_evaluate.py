"""Calls of CasADi functions on numpy's arrays, against CasADi's own."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from services.codesign.evaluate import evaluate

X, Y = ca.SX.sym("x", 2, 3), ca.SX.sym("y", 2)
FUNCTION = ca.Function("example", [X, Y], [2 * X, X.T @ Y, ca.sum1(Y)])


def test_outputs_are_casadis_own():
    x, y = np.arange(12.0).reshape(3, 4)[:, 1:3].T, np.array([1, 2])  # neither whole nor of floats
    found = evaluate(FUNCTION, x, y)
    assert [part.shape for part in found] == [(2, 3), (3, 1), (1, 1)]
    for part, expected in zip(found, FUNCTION(x, y), strict=True):
        assert np.array_equal(part, expected.full())


def test_results_stay_when_it_is_called_again():
    y = np.ones(2)
    first, *_ = evaluate(FUNCTION, np.ones((2, 3)), y)
    evaluate(FUNCTION, np.zeros((2, 3)), y)
    assert (first == 2).all()


def test_another_size_is_refused():
    with pytest.raises(ValueError, match=r"example takes \[6, 2\] numbers, not \[6, 3\]"):
        evaluate(FUNCTION, np.ones((2, 3)), np.ones(3))


def test_sparse_inputs_and_outputs_are_refused():
    """Their numbers would lie elsewhere than in numpy's arrays."""
    diagonal = ca.SX.sym("d", ca.Sparsity.diag(2))
    for sparse in (ca.Function("sparse", [Y], [ca.diag(Y)]), ca.Function("sparse", [diagonal], [ca.densify(diagonal)])):
        with pytest.raises(ValueError, match="sparse has inputs or outputs that are sparse"):
            evaluate(sparse, np.ones(sparse.numel_in(0)))


def test_a_failed_evaluation_is_an_error():
    class Fails(ca.Callback):
        def __init__(self) -> None:
            ca.Callback.__init__(self)
            self.construct("fails")

        def eval(self, _):
            raise ArithmeticError("no number")

    with pytest.raises(RuntimeError):
        evaluate(Fails(), np.ones(1))
