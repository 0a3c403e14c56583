"""The staged factorisation of any symmetric matrix, against numpy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from services.codesign.elimination import Elimination
from tests.numerics.ma27 import MA27, NO_INTEGER_SPACE, NO_REAL_SPACE, SINGULAR, WRONG_SIZE
from tests.numerics.systems import Entries, check, check_early_end, dense, lower_entries, order_of


def bordered(blocks: list[int], border: int, rng: np.random.Generator) -> np.ndarray:
    """Symmetric and indefinite: blocks that meet in the border alone."""
    size = sum(blocks) + border
    matrix, begin = rng.normal(size=(size, size)), 0
    for block in blocks:
        end = begin + block
        matrix[begin:end, :begin] = matrix[begin:end, end : size - border] = 0
        begin = end
    lower = np.tril(matrix)
    return lower + lower.T


@pytest.mark.parametrize("sizes", [[6], [40], [1, 1, 8], [7, 9, 30], [30, 1, 2, 17], [5] * 12], ids=str)
@pytest.mark.parametrize("seed", range(3))
def test_dense_indefinite_matrix(sizes, seed):
    rng = np.random.default_rng(seed)
    size = sum(sizes)
    matrix = rng.normal(size=(size, size))
    check(order_of(sizes), size, lower_entries(matrix + matrix.T))


@pytest.mark.parametrize(
    ("sizes", "chains"),
    [([4, 5, 6, 7], (0, 1, 2, 3)), ([4, 5, 6, 7, 3, 2], (0, 2, 4)), ([9, 1, 2, 8, 30], (0, 1, 3)), ([5, 6], (0, 1))],
    ids=str,
)
@pytest.mark.parametrize("threads", [1, 2, 5])
def test_chains_that_meet_in_the_trunk(sizes, chains, threads):
    rng = np.random.default_rng(len(sizes))
    ends = [sum(sizes[:stage]) for stage in (*chains[1:], len(sizes))]
    *blocks, border = np.diff([0, *ends])
    entries = lower_entries(bordered(list(blocks), border, rng))
    check(order_of(sizes, chains=chains), sum(sizes), entries, threads)


@pytest.mark.parametrize("seed", range(6))
def test_pairs_in_chains_and_in_the_trunk_that_they_reach(seed):
    """What chains leave behind fills the columns of the trunk's pairs, and some pairs are no pivots there or here."""
    rng = np.random.default_rng(seed)
    sizes, pairs, chains = [8, 9, 7, 6, 20], [2, 3, 0, 2, 4], (0, 2, 3, 4)
    matrix = bordered([17, 7, 6], 20, rng) * (rng.random((50, 50)) < 0.7)
    first = np.concatenate([[0], np.cumsum(sizes)])
    for begin, count in zip(first, pairs, strict=False):
        for k in range(begin, begin + 2 * count, 2):
            matrix[k + 1, k + 1], matrix[k + 1, k] = 0.0, rng.choice([9.0, 1e-9], p=[0.8, 0.2])
    matrix = np.tril(matrix) + np.tril(matrix, -1).T
    check(order_of(sizes, pairs, chains), 50, lower_entries(matrix), 2)


def test_unknowns_of_a_chain_without_a_pivot_wait_for_the_trunk():
    """[0 B; B' 0] with all of B' in the trunk: no chain has a pivot of its own."""
    rng = np.random.default_rng(0)
    matrix = np.zeros((60, 60))
    matrix[:30, 30:] = rng.normal(size=(30, 30)) + 5 * np.eye(30)
    check(order_of([6, 4, 10, 10, 30], chains=(0, 2, 3, 4)), 60, lower_entries(matrix + matrix.T), 2)


def test_not_a_bit_depends_on_the_number_of_threads():
    """Whichever thread is first: ten times over, the numbers are those of one thread."""
    blocks, rng = [40] * 6, np.random.default_rng(3)
    entries = lower_entries(bordered(blocks, 12, rng))
    rhs = rng.normal(size=252)
    answers = []
    for threads in (1, *[3] * 10):
        ma27 = MA27(order_of([*blocks, 12], chains=tuple(range(7))), 252, *entries[:2], threads=threads)
        ma27.factorise(entries[2])
        answers.append(ma27.solve(rhs))
    assert all(np.array_equal(answers[0], answer) for answer in answers[1:])


def test_order_is_followed_whatever_the_numbering():
    rng = np.random.default_rng(0)
    matrix = rng.normal(size=(20, 20)) * (rng.random((20, 20)) < 0.3)
    matrix += matrix.T + np.diag(rng.normal(size=20))
    order = replace(order_of([6, 6, 8]), order=rng.permutation(20))
    check(order, 20, lower_entries(matrix))


def test_patterns_of_one_size_in_turn():
    """The plan made last is used again, but for no other pattern."""
    size, rng = 30, np.random.default_rng(4)
    i, j, k = rng.integers(0, size, (3, 200))
    for rows, columns in [(i, j), (i, k), (k, k), (k, j), (k, j), (i, j)]:
        places = np.append(rows, range(size)), np.append(columns, range(size))
        check(order_of([10, 10, 10]), size, (*places, rng.normal(size=200 + size)))


def test_entries_above_the_diagonal_and_at_the_same_place():
    rows, columns = np.array([0, 0, 1, 2, 0, 0, 1]), np.array([0, 1, 0, 2, 2, 0, 1])
    values = np.array([1.0, 2.0, 0.5, -3.0, 1.0, 0.25, 1.0])
    matrix = np.eye(8)
    matrix[:3, :3] = [[1.25, 2.5, 1.0], [2.5, 1.0, 0.0], [1.0, 0.0, -3.0]]
    more = np.arange(3, 8)
    rows, columns, values = np.append(rows, more), np.append(columns, more), np.append(values, np.ones(5))
    ma27 = MA27(order_of([1, 7]), 8, rows, columns)
    assert ma27.factorise(values) == (0, int((np.linalg.eigvalsh(matrix) < 0).sum()))
    assert ma27.solve(matrix @ np.arange(8.0)) == pytest.approx(np.arange(8.0), rel=1e-13, abs=1e-13)


def test_unknowns_without_a_pivot_in_their_stage_wait_for_the_next():
    """[0 B; B' 0]: no stage but the last has a pivot of its own."""
    rng = np.random.default_rng(0)
    matrix = np.zeros((60, 60))
    matrix[:30, 30:] = rng.normal(size=(30, 30)) + 5 * np.eye(30)
    check(order_of([10, 10, 10, 30]), 60, lower_entries(matrix + matrix.T))


def test_more_waiting_unknowns_than_there_is_room_for_ask_for_more_space():
    size = 200
    matrix = np.zeros((size, size))
    matrix[:100, 100:] = np.random.default_rng(0).normal(size=(100, 100)) + 10 * np.eye(100)
    entries = lower_entries(matrix + matrix.T)
    ma27 = MA27(order_of([25, 25, 25, 25, 100]), size, *entries[:2])
    failed, _ = ma27.factorise(entries[2])
    assert failed == NO_REAL_SPACE
    while failed == NO_REAL_SPACE:  # as IPOPT does: both arrays anew
        ma27.allocate(2 * int(ma27.info[1]), 2 * len(ma27.iw))
        failed, negative = ma27.factorise(entries[2])
    assert (failed, negative) == (0, 100)
    x = ma27.solve(dense(size, entries) @ np.ones(size))
    assert x == pytest.approx(np.ones(size), rel=1e-9)


def test_too_little_space_is_said():
    entries = lower_entries(np.eye(30) + np.ones((30, 30)))
    ma27 = MA27(order_of([10, 10, 10]), 30, *entries[:2])
    reals, integers = len(ma27.a), len(ma27.iw)
    ma27.allocate(reals - 1, integers)
    assert ma27.factorise(entries[2])[0] == NO_REAL_SPACE
    assert ma27.info[1] == reals
    ma27.allocate(reals, integers - 1)
    assert ma27.factorise(entries[2])[0] == NO_INTEGER_SPACE
    assert ma27.info[1] == integers
    ma27.allocate(reals, 10)
    assert ma27.factorise(entries[2])[0] == NO_INTEGER_SPACE
    ma27.allocate(reals, integers)
    assert ma27.factorise(entries[2])[0] == 0


@pytest.mark.parametrize(("stages", "status"), [(1900, 0), (2000, 0), (2200, WRONG_SIZE)])
def test_space_beyond_what_integers_count_is_not_asked_for(stages, status, monkeypatch):
    """Fronts of a thousand: room for delayed candidates is left out first, and what is too large still is refused."""
    asked = []
    monkeypatch.setattr(MA27, "allocate", lambda self, reals, integers: asked.append((reals, integers)))
    unknowns = np.arange(1000 * stages)
    ma27 = MA27(order_of([1000] * stages), len(unknowns), unknowns, unknowns)
    assert ma27.status == status
    (sizes,) = asked
    assert sizes == (0, 0) if status else min(sizes) > len(unknowns)


def test_singular_matrix_is_said():
    """Two equal constraints, in numbers whose sums are exact."""
    matrix = np.diag([1.0, 2.0, 4.0, 8.0, 8.0, 8.0, 8.0, 8.0, 0.0, 0.0])
    matrix[8:, :8] = 1.0
    for sizes in ([10], [8, 2], [4, 4, 2]):
        entries = lower_entries(matrix)
        ma27 = MA27(order_of(sizes), 10, *entries[:2])
        assert ma27.factorise(entries[2])[0] == SINGULAR


def test_order_for_another_size_is_refused():
    entries = lower_entries(np.eye(4))
    assert MA27(order_of([2, 3]), 4, *entries[:2]).status == WRONG_SIZE


@pytest.mark.parametrize("weight", [-2.0, 0.0, 1.0, 1e8])
@pytest.mark.parametrize("dual", [0.0, -1e-8, -0.5])
@pytest.mark.parametrize("coupling", [1.0, 1e-2, 1e-6, 0.0])
def test_pairs(weight, dual, coupling):
    """A variable and the constraint that fixes it: eliminated as a pair, or with the others where that is no pivot."""
    rng = np.random.default_rng(3)
    matrix = np.zeros((12, 12))
    rest = rng.normal(size=(8, 8))
    matrix[4:, 4:] = rest @ rest.T + np.eye(8)
    for k in (0, 2):
        matrix[k, k], matrix[k + 1, k + 1] = weight, dual
        matrix[k + 1, k] = coupling
        matrix[4:, k + 1] = rng.normal(size=8) * (rng.random(8) < 0.5)
        matrix[4 + k :, k] = rng.normal(size=8 - k)
    matrix = np.tril(matrix) + np.tril(matrix, -1).T
    check(order_of([8, 4], [2, 0]), 12, lower_entries(matrix))


def test_more_pairs_than_in_the_stage_before():
    """Columns that held candidates there are those of pairs here."""
    rng = np.random.default_rng(1)
    matrix = rng.normal(size=(160, 160))
    check(order_of([100, 60], [0, 30]), 160, lower_entries(matrix + matrix.T))


@pytest.mark.parametrize("times", [1, 3, 8, 40])
def test_arrays_larger_than_asked_for(times):
    """They give room to more candidates that wait, in a plan of the same length."""
    rng = np.random.default_rng(2)
    matrix = rng.normal(size=(12, 12))
    for k in (0, 2):
        matrix[k + 1, k + 1], matrix[k + 1, k] = 0.0, 9.0
    matrix = np.tril(matrix) + np.tril(matrix, -1).T
    rows, columns, values = lower_entries(matrix)
    ma27 = MA27(order_of([8, 4], [2, 0]), 12, rows, columns)
    ma27.allocate(times * len(ma27.a), times * len(ma27.iw))
    assert ma27.factorise(values) == (0, int((np.linalg.eigvalsh(matrix) < 0).sum()))
    assert ma27.solve(matrix @ np.arange(12.0)) == pytest.approx(np.arange(12.0), abs=1e-10)


@pytest.mark.parametrize("seed", range(12))
def test_pairs_in_many_stages(seed):
    """Sparse stages of pairs and others on a chain with a border; some pairs are no pivots, some unknowns must wait."""
    rng = np.random.default_rng(seed)
    stages, pairs, others, border = 6, 5, 7, 9
    own = 2 * pairs + others
    size = stages * own + border
    matrix = np.zeros((size, size))
    for first in range(0, size - border, own):
        for k in range(first, first + 2 * pairs, 2):
            coupled = [*range(k + 2, first + own), *range(first + own, first + own + 6, 2), *range(size - border, size)]
            matrix[coupled, k] = rng.normal(size=len(coupled)) * (rng.random(len(coupled)) < 0.6)
            matrix[coupled, k + 1] = rng.normal(size=len(coupled)) * (rng.random(len(coupled)) < 0.2)
            matrix[k, k], matrix[k + 1, k] = rng.normal(), rng.choice([1.0, 1e-9], p=[0.9, 0.1])
            matrix[k + 1, k + 1] = rng.choice([0.0, -1e-8], p=[0.95, 0.05])
        rest = [*range(first + 2 * pairs, first + own), *range(size - border, size)]
        matrix[np.ix_(rest, rest)] += np.tril(rng.normal(size=(len(rest), len(rest))))
    for first in range(0, size - border - own, own):  # two unknowns that meet no other of their stage must wait
        waiting, later = [first + own - 2, first + own - 1], range(first + own, first + 2 * own)
        matrix[waiting, :] = matrix[:, waiting] = 0
        matrix[np.ix_(later, waiting)] = rng.normal(size=(own, 2))
    matrix = np.tril(matrix) + np.tril(matrix, -1).T
    check(order_of([own] * stages + [border], [pairs] * stages + [0]), size, lower_entries(matrix))


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("chains", [(0,), (0, 3, 6)])
@pytest.mark.parametrize("waiting", [False, True])
def test_too_many_negative_eigenvalues_are_known_early(seed, chains, waiting):
    """Whatever stage the negative curvature is in; and never said of a system that has none."""
    rng = np.random.default_rng(seed)
    curvatures = rng.choice([2.0, -2.0], 7, p=[0.85, 0.15])
    order, entries = optimality_system(stages=7, chains=chains, curvatures=curvatures, waiting=waiting, rng=rng)
    check(replace(order, multipliers=0), len(order.order), entries)
    check_early_end(order, len(order.order), entries)


@pytest.mark.parametrize("curvatures", [(-1.0, 1.0), (-1.0, -1.0), (1.0, 1.0)])
def test_a_constraint_of_a_later_stage_may_hold_what_came_before(curvatures):
    """Negative curvature along the first variable alone, which the constraint that comes after it does not allow."""
    padding = 8
    matrix = np.eye(3 + padding)
    matrix[0, 0], matrix[1, 1] = curvatures
    y = 2 + padding
    matrix[y, :] = matrix[:, y] = 0.0
    matrix[0, y] = matrix[y, 0] = 1.0
    order = replace(order_of([1, 2 + padding]), multipliers=1)
    check_early_end(order, 3 + padding, lower_entries(matrix))


@pytest.mark.parametrize("waiting", [False, True])
def test_an_early_end_leaves_the_rest_out(waiting):
    """With negative curvatures in the first and in the last stages the last two are not looked at."""
    rng, curvatures = np.random.default_rng(0), [-2.0, 2, 2, 2, -2, -2, 2]
    order, entries = optimality_system(stages=7, chains=(0,), curvatures=curvatures, waiting=waiting, rng=rng)
    size = len(order.order)
    whole = MA27(replace(order, multipliers=0), size, *entries[:2]).factorise(entries[2])
    assert whole[1] > order.multipliers + 1
    rows, columns, values = entries
    last = np.isin(rows, order.order[order.first[5] :]) & np.isin(columns, order.order[order.first[5] :])
    unread = np.where(last, np.nan, values)
    assert MA27(order, size, rows, columns).factorise(unread) == (0, order.multipliers + 1)


def optimality_system(
    *, stages: int, chains: tuple[int, ...], curvatures: Sequence[float], waiting: bool, rng: np.random.Generator
) -> tuple[Elimination, Entries]:
    """Stages of five variables and two constraints; constraints reach the next stage of their chain and the last stage.

    Curvatures are of about the size given, in all of a stage's variables. With `waiting` the second constraint does not
    hold its own stage, so that its multiplier has no pivot there.
    """
    variables, constraints = 5, 2
    first_multiplier = stages * variables
    size = first_multiplier + stages * constraints
    matrix = np.zeros((size, size))
    for s in range(stages):
        x = s * variables + np.arange(variables)
        y = first_multiplier + s * constraints + np.arange(constraints)
        part = rng.normal(size=(variables, variables))
        matrix[np.ix_(x, x)] = curvatures[s] * np.eye(variables) + 0.1 * (part + part.T)
        next_stage = [] if s + 1 in (*chains, stages) else [x + variables]
        for reached in (x, *next_stage, np.arange(first_multiplier - variables, first_multiplier)):
            matrix[np.ix_(y, reached)] = rng.normal(size=(constraints, len(reached)))
        if waiting and s + 1 < stages:
            matrix[y[1], x] = 0
    order = np.concatenate(
        [
            np.r_[s * variables : (s + 1) * variables, first_multiplier + 2 * s : first_multiplier + 2 * s + 2]
            for s in range(stages)
        ]
    )
    first = (variables + constraints) * np.arange(stages + 1)
    elimination = Elimination(
        order, first, np.zeros(stages, dtype=int), np.array(chains), multipliers=stages * constraints
    )
    return elimination, lower_entries(matrix)
