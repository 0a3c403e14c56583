"""Everything a claimed job needs, read from the database once, so that no transaction spans a solve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from sqlalchemy import Engine, select

from services.codesign.solve import References
from services.jobs.claim import Claim
from services.jobs.plan import JobSpec
from services.jobs.resolved import ResolvedApplication
from services.jobs.store import results_of
from shared.db.engine import reading
from shared.db.tables import Application, Design, Result
from shared.domain import Stage

MILLIMETRE = 1e-3


@dataclass(frozen=True)
class Work:
    """One job, ready to be executed."""

    spec: JobSpec
    application: ResolvedApplication
    own_designs: dict[int, np.ndarray]  # reconcile: each solved task's design, (n, 7) m
    design: np.ndarray | None = None  # motions: the design given, (n, 7) m
    references: References | None = None  # motions of a weighted objective: those of the task's own solve


def load_work(engine: Engine, held: Claim) -> Work | None:
    """Read a job's inputs; None when its application was deleted."""
    with reading(engine) as session:
        application = session.get(Application, held.application_id)
        if application is None:
            return None
        resolved = ResolvedApplication.model_validate(application.resolved)
        own: dict[int, np.ndarray] = {}
        if held.spec.stage == Stage.RECONCILE:
            results = results_of(session, application, Stage.CODESIGN)
            own = {r.task_index: design_array(r.summary["design_mm"]) for r in results if r.summary.get("design_mm")}
        if held.spec.stage != Stage.MOTIONS:
            return Work(held.spec, resolved, own)
        design = session.get_one(Design, (application.id, application.generation, held.spec.method))
        mine = session.scalars(
            select(Result).where(
                Result.application_id == application.id,
                Result.generation == application.generation,
                Result.stage == Stage.CODESIGN,
                Result.task_index == held.spec.task_index,
            )
        ).one_or_none()
        return Work(
            held.spec,
            resolved,
            own,
            design_array(design.content["design_mm"]),
            _references(mine),
        )


def design_array(design_mm: list[list[float]]) -> np.ndarray:
    """Design in mm, as stored -> shape (n, 7) in m."""
    return np.array(design_mm) * MILLIMETRE


def _references(own: Result | None) -> References | None:
    found = None if own is None else own.summary.get("references")
    return None if found is None else References(found["time_s"], found["energy_V2s"])
