"""The staged factorisation against numpy, and IPOPT with it against IPOPT with MUMPS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from services.codesign import kernels as kernels_module
from services.codesign import solver as solver_module
from services.codesign import staged_ldl as staged_module
from services.codesign.elimination import Elimination, elimination
from services.codesign.guess import quintic_guess, starting_design
from services.codesign.instance import Instance, build_instance
from services.codesign.motor_data import MotorData
from services.codesign.problem import Objective, Problem, Task, Transcription
from services.codesign.program import Program, build_program, load_program
from services.codesign.reconcile import feasible_design
from services.codesign.solve import solve
from services.codesign.solver import MUMPS, STAGED, SolverOptions, run
from services.codesign.staged_ldl import library_name, load_staged_ldl
from tests.numerics.arms import random_robot
from tests.numerics.ma27 import MA27, NO_INTEGER_SPACE, NO_REAL_SPACE, SINGULAR, WRONG_SIZE
from tests.numerics.tasks import paper_problem

BACKWARD = 1e-11
"""Residual over |A| |x|: rounding, times a growth of 1e4 that the pivot threshold allows."""

SAME_POINT = 1e-6
"""Two factorisations of the same systems end at points this near, at tol 1e-8."""

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


def order_of(sizes: list[int], pairs: list[int] | None = None, chains: tuple[int, ...] = (0,)) -> Elimination:
    first = np.concatenate([[0], np.cumsum(sizes)])
    return Elimination(np.arange(first[-1]), first, np.array(pairs or [0] * len(sizes)), np.array(chains))


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


# ---- any symmetric matrix


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


# ---- the systems of programs


def system(program: Program, instance: Instance, spread: float = 3.0) -> tuple[int, Entries]:
    """A system as IPOPT would solve it on its way: random multipliers, barrier terms from 10^-spread to 10^spread."""
    rng = np.random.default_rng(0)
    x = rng.uniform(0.9, 1.1, program.variables)
    x[program.time_index] = 0.5
    hessian = program.hess_lag(x, instance.parameters, 1.0, rng.normal(size=program.constraints)).full()
    jacobian = program.jac_g(x, instance.parameters)[1].full()
    free, equal = instance.lower_x != instance.upper_x, instance.lower_g == instance.upper_g
    n, s, m = free.sum(), (~equal).sum(), len(equal)
    matrix = np.zeros((n + s + m, n + s + m))
    matrix[:n, :n] = (hessian + np.triu(hessian, 1).T)[np.ix_(free, free)]
    matrix[np.arange(n + s), np.arange(n + s)] += 10 ** rng.uniform(-spread, spread, n + s)
    matrix[n + s : n + s + equal.sum(), :n] = jacobian[np.ix_(equal, free)]
    matrix[n + s + equal.sum() :, :n] = jacobian[np.ix_(~equal, free)]
    matrix[n + s + equal.sum() + np.arange(s), n + np.arange(s)] = -1
    return len(matrix), lower_entries(np.tril(matrix))


TRANSCRIPTIONS = [
    Transcription(scheme, degree, intervals, control)
    for scheme, degree in (("radau", 1), ("radau", 3), ("legendre", 1), ("legendre", 2))
    for control in ("voltage", "current")
    for intervals in (1, 2, 7)
]


def problem_of(transcription: Transcription, **changes) -> Problem:
    robot = random_robot(2)
    task = Task(np.zeros(2), np.array([0.3, -0.2]), 1.0, duration=0.8)
    return Problem(robot, task, transcription=transcription, **changes)


def program_of(problem: Problem) -> Program:
    kernels = kernels_module._virtual_machine(problem.robot, problem.layout)
    return build_program(kernels, problem.layout, problem.transcription.intervals)


@pytest.mark.parametrize(
    "transcription", TRANSCRIPTIONS, ids=lambda t: f"{t.scheme}-{t.degree}-{t.control}-{t.intervals}"
)
def test_systems_of_every_transcription(transcription):
    free = problem_of(transcription)
    program = program_of(free)
    fixed = replace(free, design=np.tile(feasible_design(MotorData()), (2, 1)))
    given_time = replace(free, objective=Objective("energy"))
    for problem in (free, fixed, given_time):
        instance = build_instance(problem, program)
        size, entries = system(program, instance)
        order = elimination(program, instance)
        assert sorted(order.order) == list(range(size))
        assert order.first[-1] == size
        assert (2 * order.pairs <= np.diff(order.first)).all()
        if transcription.intervals == 1 and np.linalg.matrix_rank(dense(size, entries)) < size:
            continue  # one interval cannot bring the arm anywhere: more constraints than variables
        check(replace(order, multipliers=0), size, entries)
        check_early_end(order, size, entries)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("chains", [(0,), (0, 3, 6)])
def test_too_many_negative_eigenvalues_are_known_early(seed, chains):
    """Whatever stage the negative curvature is in; and never said of a system that has none."""
    rng = np.random.default_rng(seed)
    order, entries = optimality_system(stages=7, chains=chains, curvatures=rng.choice([2.0, 2.0, -2.0], 7), rng=rng)
    check(replace(order, multipliers=0), len(order.order), entries)
    check_early_end(order, len(order.order), entries)


def test_an_early_end_leaves_the_rest_out():
    """With negative curvatures in the first and in the last stages the last ones' are not counted."""
    rng = np.random.default_rng(0)
    order, entries = optimality_system(stages=7, chains=(0,), curvatures=[-2.0, 2, 2, 2, -2, -2, 2], rng=rng)
    size = len(order.order)
    whole = MA27(replace(order, multipliers=0), size, *entries[:2]).factorise(entries[2])
    assert whole[1] > order.multipliers + 1
    assert MA27(order, size, *entries[:2]).factorise(entries[2]) == (0, order.multipliers + 1)


def check_early_end(order: Elimination, size: int, entries: Entries) -> None:
    """IPOPT gets the same answer as from the whole factorisation: as many negative eigenvalues, or too many."""
    negative = int((np.linalg.eigvalsh(dense(size, entries)) < 0).sum())
    status, found = MA27(order, size, *entries[:2], threads=2).factorise(entries[2])
    assert status == 0
    assert found == negative if negative <= order.multipliers else found > order.multipliers


def optimality_system(
    *, stages: int, chains: tuple[int, ...], curvatures: Sequence[float], rng: np.random.Generator
) -> tuple[Elimination, Entries]:
    """Stages of five variables and two constraints; constraints reach the next stage of their chain and the last stage.

    Curvatures are of about the size given, in all of a stage's variables.
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


def test_fronts_do_not_grow_with_the_number_of_intervals():
    """The space asked for is linear in the intervals: nothing but state, design and t_f is handed on."""
    spaces = []
    for intervals in (10, 20, 40):
        problem = problem_of(Transcription("radau", 1, intervals))
        program = program_of(problem)
        instance = build_instance(problem, program)
        size, entries = system(program, instance)
        spaces.append(len(MA27(elimination(program, instance), size, *entries[:2]).a))
    assert spaces[2] - spaces[1] == pytest.approx(2 * (spaces[1] - spaces[0]), rel=0.01)


# ---- IPOPT with it


@pytest.fixture
def no_library(monkeypatch):
    monkeypatch.setattr(solver_module, "load_staged_ldl", lambda: None)


@pytest.mark.parametrize("kind", ["time", "energy"])
def test_same_solution_as_with_mumps(kind, request):
    problem, options = paper_problem(0.6, 2.0, kind), SolverOptions(tol=1e-8)
    ours = solve(problem, options=options)
    request.getfixturevalue("no_library")
    theirs = solve(problem, options=options)
    assert [a.linear_solver for a in (*ours.attempts, *theirs.attempts)] == [STAGED, MUMPS]
    assert ours.objective == pytest.approx(theirs.objective, rel=SAME_POINT)


def test_same_iterates_as_with_mumps(request):
    """Exact arithmetic would make them equal; rounding grows on the way, so only the first ten are compared."""
    problem = paper_problem(0.4, 1.0)
    program = load_program(problem.robot, problem.layout, 50)
    instance = build_instance(problem, program)
    start = quintic_guess(problem, program, instance, starting_design(problem))
    points = []
    for fixture in (None, "no_library"):
        if fixture is not None:
            request.getfixturevalue(fixture)
        points.append(run(program, instance, start, SolverOptions(max_iter=10)).x)
    assert np.abs(points[0] - points[1]).max() < SAME_POINT


def test_without_a_compiler_mumps_solves_and_the_result_says_so(monkeypatch, tmp_path):
    load_program(paper_problem(0.2, 0.0).robot, paper_problem(0.2, 0.0).layout, 50)
    monkeypatch.setattr(staged_module, "default_cache", lambda: tmp_path)
    monkeypatch.setattr(kernels_module, "_compiler", lambda: None)
    assert load_staged_ldl() is None
    solution = solve(paper_problem(0.2, 0.0))
    assert solution.success
    assert [a.linear_solver for a in solution.attempts] == [MUMPS]


def test_mumps_takes_over_where_the_staged_factorisation_refuses(monkeypatch):
    """An order for another system is what IPOPT's own changes to a program would amount to."""
    wrong = order_of([2, 3])
    monkeypatch.setattr(solver_module, "elimination", lambda program, instance: wrong)
    solution = solve(paper_problem(0.2, 0.0))
    assert solution.success
    assert [a.linear_solver for a in solution.attempts] == [MUMPS]


def test_library_is_another_for_other_flags_sources_and_processors(monkeypatch, tmp_path):
    names = {library_name()}
    monkeypatch.setattr(staged_module, "COMPILER_FLAGS", ("-O0",))
    names.add(library_name())
    monkeypatch.setattr(staged_module, "processor", lambda: ["another"])
    names.add(library_name())
    other = tmp_path / "other.c"
    other.write_text("int nothing;")
    monkeypatch.setattr(staged_module, "SOURCE", other)
    names.add(library_name())
    assert len(names) == 4
