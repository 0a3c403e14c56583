"""Working through a queue in one process, with stand-ins for the solves; and what has to be true of its history."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from sqlalchemy import Engine, select

from services.codesign.design_sheet import design_sheet
from services.codesign.motor_data import MotorData
from services.jobs.claim import Claim, claim
from services.jobs.finish import Outcome, finish
from shared.db.engine import reading
from shared.db.tables import Application, Job, JobTransition, Stage
from shared.domain import JobState
from shared.domain import Stage as StageName

LONG_LEASE_S = 60.0
EXPIRED_LEASE_S = -1.0

OWN = {
    "objective": 1.0,
    "final_time_s": 1.0,
    "energy_V2s": 2.0,
    "electrical_energy_J": 3.0,
    "copper_loss_J": 4.0,
    "recovered_energy_J": [0.0] * 6,
    "peaks": {},
    "rms": {},
    "certificate": {"kkt_residual": 1e-9, "limit_violation": 0.0},
    "solver_status": "Solve_Succeeded",
    "iterations": 30,
    "solve_time_s": 0.1,
}
LENGTHS_MM = [[30.0, 20.0, 40.0, 2.0, 6.0, 7.0, 2.0]] * 6
DESIGN = {"design_mm": LENGTHS_MM} | design_sheet(np.array(LENGTHS_MM) * 1e-3, MotorData())


def outcome_of(held: Claim, failing: frozenset[int] = frozenset()) -> Outcome:
    """What a stand-in solve gives."""
    if held.spec.stage == StageName.RECONCILE:
        return Outcome(
            JobState.SUCCEEDED, summary={"methods": ["two_step"]}, designs={"mean": DESIGN, "two_step": DESIGN}
        )
    if held.spec.task_index in failing:
        return Outcome(JobState.FAILED, "cannot be done", summary={"solver_status": "Infeasible"})
    return Outcome(JobState.SUCCEEDED, value=1.0, summary=OWN | DESIGN)


def queued(engine: Engine) -> list[str]:
    """Ids of all queued jobs."""
    with reading(engine) as session:
        return list(session.scalars(select(Job.id).where(Job.state == JobState.QUEUED).order_by(Job.id)))


def take(engine: Engine, lease_s: float = LONG_LEASE_S) -> Claim:
    """Claim the first queued job."""
    held = claim(engine, queued(engine)[0], "worker", lease_s)
    assert held is not None
    return held


def drain(engine: Engine, failing: frozenset[int] = frozenset()) -> None:
    """Run everything that is queued, and what follows from it."""
    while jobs := queued(engine):
        for job_id in jobs:
            held = claim(engine, job_id, "worker", LONG_LEASE_S)
            if held is not None:
                assert finish(engine, held, outcome_of(held, failing))


def rows(engine: Engine, statement: Any) -> list[Any]:
    """Result rows."""
    with reading(engine) as session:
        return list(session.execute(statement))


def state_of(engine: Engine, application_id: str) -> tuple[str, str | None]:
    """State and reason."""
    with reading(engine) as session:
        row = session.get_one(Application, application_id)
        return row.state, row.reason


def assert_history_is_sound(engine: Engine, application_id: str) -> None:
    """Every job final exactly once, counters at zero, one reconcile at most."""
    final = [state for state in JobState if state.final]
    ends = Counter(
        row.job_id for row in rows(engine, select(JobTransition.job_id).where(JobTransition.to_state.in_(final)))
    )
    jobs = rows(engine, select(Job.id, Job.state, Job.stage).where(Job.application_id == application_id))
    assert set(ends) == {row.id for row in jobs}
    assert set(ends.values()) == {1}
    assert all(JobState(row.state).final for row in jobs)
    assert [row.remaining for row in rows(engine, select(Stage.remaining))] == [0] * len({row.stage for row in jobs})
    assert sum(row.stage == StageName.RECONCILE for row in jobs) <= 1
