"""The judge: whether everything that was accepted ended as promised, read from the append-only history."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from sqlalchemy import Engine, select

from shared.db.engine import reading
from shared.db.tables import Application, Job, JobTransition, Result, Stage
from shared.domain import TRANSITIONS, ApplicationState, JobState
from shared.domain import Stage as StageName


def assert_true_to_its_word(engine: Engine, accepted: Sequence[str]) -> None:
    """Every accepted application and job final exactly once, counters zero, one reconcile a generation."""
    with reading(engine) as session:
        applications = {row.id: row.state for row in session.execute(select(Application.id, Application.state))}
        jobs = {
            row.id: row
            for row in session.execute(select(Job.id, Job.state, Job.application_id, Job.generation, Job.stage))
        }
        history = session.execute(select(JobTransition).order_by(JobTransition.id)).scalars().all()
        remaining = list(session.scalars(select(Stage.remaining)))
        results = list(session.scalars(select(Result.job_id)))
    assert set(accepted) <= set(applications), "an accepted application is lost"
    assert all(ApplicationState(state).final for state in applications.values()), applications
    assert set(remaining) == {0}
    state = dict.fromkeys(jobs, JobState.QUEUED)
    ends: Counter[str] = Counter()
    for step in history:
        assert step.from_state == state[step.job_id], f"{step.job_id}: from {step.from_state}, was {state[step.job_id]}"
        assert step.to_state in TRANSITIONS.get(JobState(step.from_state), frozenset())
        state[step.job_id] = JobState(step.to_state)
        ends[step.job_id] += JobState(step.to_state).final
    assert state == {job_id: row.state for job_id, row in jobs.items()}
    assert {ends[job_id] for job_id in jobs} == {1}
    reconciles = Counter((j.application_id, j.generation) for j in jobs.values() if j.stage == StageName.RECONCILE)
    assert set(reconciles.values()) <= {1}
    whole = {name for name, value in applications.items() if value == ApplicationState.SUCCEEDED}
    assert whole <= {name for name, _ in reconciles}
    assert len(results) == len(set(results)), "a job has two results"
    assert {job_id for job_id, row in jobs.items() if row.state == JobState.SUCCEEDED} <= set(results)
