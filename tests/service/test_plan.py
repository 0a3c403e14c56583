"""The planner: what follows a stage, without a database."""

from __future__ import annotations

import pytest

from services.jobs.plan import Done, JobSpec, NextStage, Progress, plan_first, plan_next, planned_jobs
from services.jobs.resolve import resolve
from services.jobs.resolved import ResolvedApplication
from shared.contracts.application import ApplicationRequest
from shared.domain import ApplicationState, Stage
from tests.service.requests import grid


@pytest.fixture
def application() -> ResolvedApplication:
    """Four tasks, three methods."""
    request = ApplicationRequest(**grid(compare=["empirical", "worst_case"]))
    return resolve(request, lambda _: None, max_tasks=100)


def after(stage: Stage, **changes: object) -> Progress:
    """Everything went well up to `stage`, but for `changes`."""
    values = {
        "finished": stage,
        "solved_tasks": (0, 1, 2, 3),
        "designs": frozenset({"mean", "two_step", "empirical", "worst_case"}),
        "motions": 4,
        "failures": 0,
    }
    return Progress(**{**values, **changes})  # type: ignore[arg-type]


def test_every_task_is_codesigned_first(application: ResolvedApplication) -> None:
    assert plan_first(application) == NextStage(
        Stage.CODESIGN, tuple(JobSpec(Stage.CODESIGN, task_index=k) for k in range(4))
    )


def test_one_reconcile_follows(application: ResolvedApplication) -> None:
    assert plan_next(application, after(Stage.CODESIGN)) == NextStage(Stage.RECONCILE, (JobSpec(Stage.RECONCILE),))


def test_motions_of_every_design_and_task_follow(application: ResolvedApplication) -> None:
    following = plan_next(application, after(Stage.RECONCILE))
    assert isinstance(following, NextStage)
    assert {(job.method, job.task_index) for job in following.jobs} == {
        (method, task) for method in ("two_step", "empirical", "worst_case") for task in range(4)
    }
    assert sum(planned_jobs(application).values()) == 4 + 1 + 12


def test_a_failed_task_is_left_out_of_the_motions_and_said(application: ResolvedApplication) -> None:
    following = plan_next(application, after(Stage.RECONCILE, solved_tasks=(0, 3), failures=2))
    assert isinstance(following, NextStage)
    assert {job.task_index for job in following.jobs} == {0, 3}
    done = plan_next(application, after(Stage.MOTIONS, solved_tasks=(0, 3), failures=2))
    assert done == Done(ApplicationState.COMPLETED_WITH_FAILURES, "2 solves failed")


def test_a_method_without_a_design_is_left_out_and_said(application: ResolvedApplication) -> None:
    designs = frozenset({"two_step", "worst_case"})
    following = plan_next(application, after(Stage.RECONCILE, designs=designs))
    assert isinstance(following, NextStage)
    assert {job.method for job in following.jobs} == designs
    done = plan_next(application, after(Stage.MOTIONS, designs=designs))
    assert done == Done(ApplicationState.COMPLETED_WITH_FAILURES, "method empirical has no design")


@pytest.mark.parametrize(
    "progress",
    [
        after(Stage.CODESIGN, solved_tasks=()),
        after(Stage.RECONCILE, designs=frozenset({"empirical"})),
        after(Stage.MOTIONS, motions=0),
    ],
)
def test_an_application_without_a_result_fails(application: ResolvedApplication, progress: Progress) -> None:
    done = plan_next(application, progress)
    assert isinstance(done, Done)
    assert done.state == ApplicationState.FAILED
    assert done.reason


def test_all_well_is_success(application: ResolvedApplication) -> None:
    assert plan_next(application, after(Stage.MOTIONS)) == Done(ApplicationState.SUCCEEDED)


def test_the_shared_optimum_follows_the_motions_it_starts_from() -> None:
    request = ApplicationRequest(**grid(method="shared_optimum", compare=["empirical"]))
    application = resolve(request, lambda _: None, max_tasks=100)
    assert application.methods == ["shared_optimum", "empirical", "two_step"]
    designs = frozenset({"mean", "two_step", "empirical"})
    motions = plan_next(application, after(Stage.RECONCILE, designs=designs))
    assert isinstance(motions, NextStage)
    assert {job.method for job in motions.jobs} == {"two_step", "empirical"}
    shared = plan_next(application, after(Stage.MOTIONS, designs=designs, motions=0))
    assert shared == NextStage(Stage.SHARED_OPTIMUM, (JobSpec(Stage.SHARED_OPTIMUM, "shared_optimum"),))
    again = plan_next(application, after(Stage.SHARED_OPTIMUM, designs=designs | {"shared_optimum"}, motions=0))
    assert isinstance(again, NextStage)
    assert {(job.stage, job.method) for job in again.jobs} == {(Stage.SHARED_MOTIONS, "shared_optimum")}
    done = plan_next(application, after(Stage.SHARED_MOTIONS, designs=designs | {"shared_optimum"}))
    assert done == Done(ApplicationState.SUCCEEDED)
    assert sum(planned_jobs(application).values()) == 4 + 1 + 8 + 1 + 4


def test_without_a_shared_design_the_application_ends_and_says_so() -> None:
    request = ApplicationRequest(**grid(compare=["shared_optimum"]))
    application = resolve(request, lambda _: None, max_tasks=100)
    done = plan_next(application, after(Stage.SHARED_OPTIMUM, designs=frozenset({"two_step"}), failures=1))
    assert done == Done(ApplicationState.COMPLETED_WITH_FAILURES, "1 solve failed; method shared_optimum has no design")
