"""The staged factorisation of the systems of programs, against numpy; and IPOPT with it, against IPOPT with MUMPS."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from services.codesign import kernels as kernels_module
from services.codesign import solver as solver_module
from services.codesign import staged_ldl as staged_module
from services.codesign.elimination import elimination
from services.codesign.guess import quintic_guess, starting_design
from services.codesign.instance import Instance, build_instance
from services.codesign.motor_data import MotorData
from services.codesign.problem import Objective, Problem, Task, Transcription
from services.codesign.program import Program, build_program, load_program
from services.codesign.reconcile import feasible_design
from services.codesign.solve import solve
from services.codesign.solver import MUMPS, STAGED, SolverOptions, run
from services.codesign.staged_ldl import StagedLDL, library_name, load_staged_ldl
from tests.numerics.arms import random_robot
from tests.numerics.ma27 import MA27
from tests.numerics.systems import Entries, check, check_early_end, dense, lower_entries, order_of
from tests.numerics.tasks import paper_problem

SAME_POINT = 1e-6
"""Two factorisations of the same systems end at points this near, at tol 1e-8."""

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


@pytest.mark.parametrize(("kind", "apart"), [("time", 1e-5), ("energy", SAME_POINT)])
def test_same_solution_as_with_mumps(kind, apart, request):
    """For time rounding decides between motions of the wrist that are 1e-6 apart."""
    problem, options = paper_problem(0.6, 2.0, kind), SolverOptions(tol=1e-8)
    ours = solve(problem, options=options)
    request.getfixturevalue("no_library")
    theirs = solve(problem, options=options)
    assert {a.linear_solver for a in ours.attempts} == {STAGED}
    assert {a.linear_solver for a in theirs.attempts} == {MUMPS}
    assert ours.objective == pytest.approx(theirs.objective, rel=apart)


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
    assert {a.linear_solver for a in solution.attempts} == {MUMPS}


def test_mumps_takes_over_where_the_staged_factorisation_refuses(monkeypatch):
    """An order for another system is what IPOPT's own changes to a program would amount to."""
    wrong = order_of([2, 3])
    monkeypatch.setattr(solver_module, "elimination", lambda program, instance: wrong)
    solution = solve(paper_problem(0.2, 0.0))
    assert solution.success
    assert {a.linear_solver for a in solution.attempts} == {MUMPS}


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


def test_what_is_compiled_is_what_the_name_is_of(monkeypatch, tmp_path):
    """Where the source changes after its name is known: else the old name would keep the new code for good."""
    source = tmp_path / "source.c"
    monkeypatch.setattr(staged_module, "SOURCE", source)
    source.write_text("int version(void) { return 1; }")
    name = library_name()
    source.write_text("int version(void) { return 2; }")
    loaded = load_staged_ldl(tmp_path)
    assert isinstance(loaded, StagedLDL)
    assert loaded.path.stem == name
    assert loaded.library.version() == 1
