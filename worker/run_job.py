"""One job from claim to finish, with a heartbeat beside the solve.

What is raised on the way, but for an outage of the database, is the job's outcome: it fails, with the reason, and is
not tried again, since the same inputs would raise the same. Only a process that dies is a lost worker.
"""

from __future__ import annotations

import time

import structlog
from billiard.compat import mem_rss  # in kB, as the pool counts it
from sqlalchemy import Engine
from sqlalchemy.exc import DBAPIError
from structlog.contextvars import bound_contextvars

from services.codesign.solver import SolverOptions
from services.jobs.claim import Claim, claim, claim_unsent, release
from services.jobs.execute import execute
from services.jobs.finish import Outcome, finish
from services.jobs.store import LONGEST_REASON
from services.jobs.work import load_work
from shared.contracts.errors import printable
from shared.domain import JobState
from shared.settings import Settings
from worker.drain import draining
from worker.heartbeat import Heartbeat
from worker.patience import for_the_next, passes, patiently
from worker.sign_of_life import worker_name

log = structlog.get_logger()

GO_ON_S = 0.2
"""How long a process goes on with one job after the other, before it asks the broker for its next message."""
GIVING_BACK_S = 10.0
"""How long a worker that ends tries to give a job back; after that its lease expires and the attempt counts."""


def wake_up(engine: Engine, settings: Settings, job_id: str) -> None:
    """Do the job that a message is about, and then those whose messages are not sent yet, for `GO_ON_S`.

    Jobs that are soon at their end would else cost less than their messages. A message whose job somebody else has
    taken wakes nobody up: others may stand behind it in the broker that are older than what was not sent.
    """
    until = time.monotonic() + GO_ON_S
    if not run_job(engine, settings, job_id):
        return
    while time.monotonic() < until and _may_go_on(settings):
        held = _next(engine, settings)
        if held is None:
            return
        with bound_contextvars(job=held.job_id):
            _run(engine, settings, held)


def _may_go_on(settings: Settings) -> bool:
    """Not when the worker shuts down, nor where the pool will replace this process for the memory that it has held."""
    return not draining() and mem_rss() <= 1000 * settings.solver_memory_mb


def _next(engine: Engine, settings: Settings) -> Claim | None:
    """A job that was not sent. An outage is not waited out here: a claim whose answer was lost would be made of another
    job, and the next message comes when the database is back."""
    try:
        return claim_unsent(engine, worker_name(), settings.lease_s)
    except DBAPIError as error:
        if not passes(error):
            raise
        log.warning("no job taken without a message", error=str(error.orig))
        return None


def run_job(engine: Engine, settings: Settings, job_id: str) -> bool:
    """Claim a job, solve it, record the outcome; returns whether it was queued, else it is left alone."""
    with bound_contextvars(job=job_id):
        held = patiently(lambda: claim(engine, job_id, worker_name(), settings.lease_s))
        if held is None:
            log.info("job not queued, message ignored")
            return False
        _run(engine, settings, held)
        return True


def _run(engine: Engine, settings: Settings, held: Claim) -> None:
    with bound_contextvars(application=held.application_id, stage=held.spec.stage, task=held.spec.task_index):
        log.info("job claimed", token=held.token)
        _solve(engine, settings, held)


def _solve(engine: Engine, settings: Settings, held: Claim) -> None:
    with Heartbeat(engine, settings, held) as heartbeat:
        outcome = _outcome(engine, settings, held, heartbeat)
    if outcome is None:
        log.info("application deleted meanwhile, job dropped")
        return
    if heartbeat.gave_up:
        accepted = patiently(lambda: release(engine, held), for_the_next(GIVING_BACK_S))
        log.info("job given back", accepted=accepted)
        return
    accepted = _record(engine, held, outcome)
    log.info("job finished", state=outcome.state, value=outcome.value, reason=outcome.reason, accepted=accepted)


def _outcome(engine: Engine, settings: Settings, held: Claim, heartbeat: Heartbeat) -> Outcome | None:
    """What comes of a claimed job; None when its application was deleted."""
    options = SolverOptions(max_wall_time=settings.solve_time_limit_s, threads=settings.shared_threads)
    try:
        work = patiently(lambda: load_work(engine, held))
        return None if work is None else execute(work, options, heartbeat.should_stop, heartbeat.search_stopped.is_set)
    except Exception as error:
        if _is_outage(error):
            raise
        log.exception("job raised an exception")
        return _raised("solving", error)


def _record(engine: Engine, held: Claim, outcome: Outcome) -> bool:
    """Store an outcome, or that it cannot be stored."""
    try:
        return patiently(lambda: finish(engine, held, outcome))
    except Exception as error:
        if _is_outage(error):
            raise
        log.exception("outcome cannot be stored")
        unstored = _raised("storing the result", error)
        return patiently(lambda: finish(engine, held, unstored))


def _is_outage(error: Exception) -> bool:
    """The database is away, and so must this worker be: somebody else does the job."""
    return isinstance(error, DBAPIError) and passes(error)


def _raised(doing: str, error: Exception) -> Outcome:
    return Outcome(JobState.FAILED, printable(f"{doing} raised {type(error).__name__}: {error}")[:LONGEST_REASON])
