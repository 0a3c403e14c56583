"""The judge: whether everything that was accepted ended as promised, read from the append-only history."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence

from sqlalchemy import Engine, Row, select

from shared.db.engine import reading
from shared.db.tables import Application, Event, Job, JobTransition, Result, Stage
from shared.domain import TRANSITIONS, ApplicationState, JobState
from shared.domain import Stage as StageName


def assert_true_to_its_word(engine: Engine, accepted: Sequence[str]) -> None:
    """Every accepted application and job final exactly once, counters zero, one reconcile a generation."""
    assert_nothing_is_lost(engine, accepted)
    assert_jobs_end_once(engine)
    assert_applications_end_once(engine)
    assert_one_reconcile(engine)


def assert_nothing_is_lost(engine: Engine, accepted: Sequence[str]) -> None:
    """Applications are there and final, and no stage waits for anything."""
    with reading(engine) as session:
        states = dict(session.execute(select(Application.id, Application.state)).all())
        remaining = set(session.scalars(select(Stage.remaining)))
    assert set(accepted) <= set(states), "an accepted application is lost"
    assert all(ApplicationState(state).final for state in states.values()), states
    assert remaining == {0}


def assert_jobs_end_once(engine: Engine) -> None:
    """Each history is a way through the states with one end; each result is from the claim that ended its job."""
    with reading(engine) as session:
        jobs = dict(session.execute(select(Job.id, Job.state)).all())
        history = session.execute(select(JobTransition).order_by(JobTransition.id)).scalars().all()
        results = dict(session.execute(select(Result.job_id, Result.summary)).all())
    steps: dict[str, list[JobTransition]] = defaultdict(list)
    for step in history:
        steps[step.job_id].append(step)
    assert set(steps) == set(jobs)
    for job_id, state in jobs.items():
        claims = _follow(steps[job_id])
        assert steps[job_id][-1].to_state == state
        assert (job_id in results) >= (state == JobState.SUCCEEDED), f"job {job_id} succeeded without a result"
        if author := results.get(job_id, {}).get("solved_by"):  # stand-ins for solves say it
            assert author == claims[-1].worker, f"job {job_id}: the result of {author}, claimed by {claims[-1].worker}"


def _follow(steps: Sequence[JobTransition]) -> list[JobTransition]:
    """Check one job's history; returns its claims."""
    state, token, claims = JobState.QUEUED, 0, []
    for step in steps:
        assert step.from_state == state, f"{step.job_id}: from {step.from_state}, was {state}"
        assert step.to_state in TRANSITIONS.get(state, frozenset())
        state = JobState(step.to_state)
        if state == JobState.RUNNING:
            token += 1
            claims.append(step)
        assert step.token == token, f"{step.job_id}: token {step.token} after {token} claims"
    assert state.final
    return claims


def assert_applications_end_once(engine: Engine) -> None:
    """One event with a final state in each generation, and it is the last word."""
    with reading(engine) as session:
        applications = session.execute(select(Application.id, Application.state, Application.generation)).all()
        events = session.execute(
            select(Event.application_id, Event.number, Event.kind, Event.content).order_by(Event.number)
        ).all()
    by_application: dict[str, list[Row[str, int, str, dict[str, str]]]] = defaultdict(list)
    for event in events:
        by_application[event.application_id].append(event)
    for application in applications:
        mine = by_application[application.id]
        assert [event.number for event in mine] == list(range(1, len(mine) + 1))
        said = [event.content["state"] for event in mine if event.kind == "application"]
        ends = [state for state in said if ApplicationState(state).final]
        assert len(ends) == application.generation + 1, f"application {application.id} ended {len(ends)} times"
        assert mine[-1].content.get("state") == ends[-1] == application.state


def assert_one_reconcile(engine: Engine) -> None:
    """Exactly one in a generation with a solved task, unless a cancel came first; else none."""
    with reading(engine) as session:
        applications = session.execute(select(Application.id, Application.state, Application.generation)).all()
        jobs = session.execute(select(Job.application_id, Job.generation, Job.stage, Job.state)).all()
    reconciles = Counter((job.application_id, job.generation) for job in jobs if job.stage == StageName.RECONCILE)
    solved = {
        (job.application_id, job.generation)
        for job in jobs
        if job.stage == StageName.CODESIGN and job.state == JobState.SUCCEEDED
    }
    assert set(reconciles.values()) <= {1}
    for application in applications:
        latest = (application.id, application.generation)
        if application.state != ApplicationState.CANCELLED:
            assert reconciles[latest] == (latest in solved), f"application {application.id}: {reconciles[latest]}"


def attempts(engine: Engine) -> set[int]:
    """How often jobs were tried, over all jobs."""
    with reading(engine) as session:
        return set(session.scalars(select(Job.attempts)))


def recovery_times(engine: Engine, lost: Iterable[tuple[str, int, float]]) -> list[float]:
    """How long each lost claim (job, token, time of the loss since 1970) kept its job from its end [s]."""
    with reading(engine) as session:
        ended = {
            step.job_id: step
            for step in session.scalars(select(JobTransition))
            if JobState(step.to_state).final and step.to_state != JobState.DEAD
        }
    times = []
    for job_id, token, at in lost:
        assert ended[job_id].token > token, "the claim was not lost"
        times.append(ended[job_id].at - at)
    return times
