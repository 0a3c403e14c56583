"""With 101,000 jobs in the tables, whatever is asked often is found by index: the databases' own plans say so."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from sqlalchemy import Engine, event, select

from services.codesign.solver import IterationReport
from services.jobs import listing, results, views
from services.jobs.cancel import cancel, delete_application
from services.jobs.claim import Claim, Requests, claim, claim_unsent, release, renew, report, requests_of
from services.jobs.events import events_after
from services.jobs.finish import finish
from services.jobs.outbox import recall, relay, unclaimed
from services.jobs.overview import overview
from services.jobs.queue import queue_depth
from services.jobs.retention import forget_old
from services.jobs.retry import retry
from services.jobs.submit import submit
from services.jobs.sweep import sweep
from services.jobs.tally import tally
from services.jobs.work import load_work
from services.jobs.workers import list_workers
from shared.db.engine import make_engine
from shared.db.migrate import upgrade
from shared.db.tables import Job
from shared.domain import JobState
from shared.settings import Settings
from tests.servers import postgres_database
from tests.service.many_jobs import fill, request
from tests.service.queue_actions import EXPIRED_LEASE_S, LONG_LEASE_S, outcome_of, rows

pytestmark = pytest.mark.timeout(900)  # filling a database takes its time on a busy machine

APPLICATIONS = 1000
LARGE = frozenset({"applications", "jobs", "results", "job_transitions", "outbox", "designs", "stages", "sweep_points"})
"""Tables that grow with use; events do too, and are only ever found by their primary key."""

Statements = list[tuple[str, Any]]


class Filled:
    """A database full of finished applications, and two that go on: with jobs queued, running, and lost."""

    def __init__(self, url: str, home: Any) -> None:
        upgrade(url)
        self.settings, self.engine = Settings(home=home, database_url=url), make_engine(url)
        self.finished = fill(self.engine, self.settings, APPLICATIONS)
        self.live, self.other = (submit(self.engine, self.settings, request())[0] for _ in range(2))

    def claim(self, lease_s: float = LONG_LEASE_S) -> Claim:
        """The next queued job of the live application."""
        ids = select(Job.id).where(Job.application_id == self.live, Job.state == JobState.QUEUED).order_by(Job.id)
        held = claim(self.engine, rows(self.engine, ids.limit(1))[0].id, "worker", lease_s)
        assert held is not None
        return held


@pytest.fixture(scope="module", params=["sqlite", "postgres"])
def filled(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Filled]:
    """Filled once for all plans."""
    home = tmp_path_factory.mktemp("home")
    if request.param == "sqlite":
        filled = Filled(f"sqlite:///{home / 'armature.db'}", home)
        yield filled
        filled.engine.dispose()
        return
    with postgres_database(request.getfixturevalue("postgres")) as url:
        filled = Filled(url, home)
        yield filled
        filled.engine.dispose()


def status(filled: Filled) -> None:
    """Of one that is finished, and of one that goes on."""
    assert views.status(filled.engine, filled.finished).state == "succeeded"
    assert views.status(filled.engine, filled.live).state in ("queued", "running")


def lists(filled: Filled) -> None:
    """Pages, by state and by owner."""
    first = listing.list_applications(filled.engine, None, 20, listing.Filters())
    assert len(first.items) == 20
    for filters in (listing.Filters(), listing.Filters(state="running"), listing.Filters(owner="nobody")):
        listing.list_applications(filled.engine, first.next_cursor, 20, filters)


def details(filled: Filled) -> None:
    """What a page of the dashboard asks for."""
    overview(filled.engine, filled.finished)
    views.tasks(filled.engine, filled.finished, 0, 10)
    results.comparison(filled.engine, filled.finished)
    results.designs(filled.engine, filled.finished)
    assert results.log(filled.engine, filled.finished, 0, None)
    assert events_after(filled.engine, filled.finished, 5).items  # the original has them


def execution(filled: Filled) -> None:
    """A job's way: claim, inputs, heartbeat, report, finish; another is given back."""
    held = filled.claim()
    assert load_work(filled.engine, held) is not None
    assert renew(filled.engine, held, LONG_LEASE_S).mine
    assert requests_of(filled.engine, held) == Requests(cancelled=False, search_stopped=False)
    report(filled.engine, held, IterationReport(0, 1, 1.0))
    assert finish(filled.engine, held, outcome_of(held))
    assert release(filled.engine, filled.claim())
    assert any(claim_unsent(filled.engine, "worker", LONG_LEASE_S) for _ in range(20))


def recovery(filled: Filled) -> None:
    """The sweep finds a lost job."""
    filled.claim(EXPIRED_LEASE_S)
    assert sweep(filled.engine, 3) == 1


def depth(filled: Filled) -> None:
    """For /readyz and /metrics."""
    assert queue_depth(filled.engine).queued > 0
    list_workers(filled.engine)


def relaying(filled: Filled) -> None:
    """New messages, those to be sent again, and those that a broker lost."""
    assert relay(filled.engine, lambda _: None, -1.0)
    assert recall(filled.engine)
    relay(filled.engine, lambda _: None, LONG_LEASE_S)
    assert unclaimed(filled.engine) > 0


def counting(filled: Filled) -> None:
    """A batch of the history."""
    assert tally(filled.engine, settled_s=-1.0) > 0


def submission(filled: Filled) -> None:
    """With its look at how much is queued."""
    submit(filled.engine, filled.settings, request(), "a key")


def ends(filled: Filled) -> None:
    """Cancel, retry, delete, forget."""
    assert cancel(filled.engine, filled.other)
    assert retry(filled.engine, filled.other)
    assert cancel(filled.engine, filled.other)
    assert delete_application(filled.engine, filled.other)
    forget_old(filled.engine, 1000.0)


ACTIONS = (status, lists, details, execution, recovery, depth, relaying, counting, submission, ends)


@pytest.mark.parametrize("act", ACTIONS, ids=lambda act: str(act.__name__))
def test_no_table_is_read_through(filled: Filled, act: Callable[[Filled], None]) -> None:
    statements = recorded(filled.engine, lambda: act(filled))
    plans = [(statement, plan_of(filled.engine, statement, parameters)) for statement, parameters in statements]
    assert plans
    for statement, plan in plans:
        found = read_through(plan, stops_early="LIMIT" in statement)
        assert not found, f"{statement}\n{json.dumps(plan, indent=1)}"


def test_a_table_read_through_is_noticed(filled: Filled) -> None:
    """The judge, judged."""
    plan = plan_of(filled.engine, "SELECT count(*) FROM jobs WHERE reason = 'x'", ())
    assert read_through(plan) == {"jobs"}


def recorded(engine: Engine, act: Callable[[], None]) -> Statements:
    """What an action asks of the database, each statement once."""
    found: dict[str, Any] = {}

    def note(_connection: Any, _cursor: Any, statement: str, parameters: Any, _context: Any, many: bool) -> None:
        if not many and not statement.startswith(("INSERT", "BEGIN")):
            found.setdefault(statement, parameters)

    event.listen(engine, "before_cursor_execute", note)
    try:
        act()
    finally:
        event.remove(engine, "before_cursor_execute", note)
    return list(found.items())


def plan_of(engine: Engine, statement: str, parameters: Any) -> Any:
    """How the database would go about it."""
    explain = "EXPLAIN QUERY PLAN" if engine.dialect.name == "sqlite" else "EXPLAIN (FORMAT JSON)"
    with engine.connect() as connection:
        answer = connection.exec_driver_sql(f"{explain} {statement}", parameters).all()
        return [row[3] for row in answer] if engine.dialect.name == "sqlite" else answer[0][0]


def read_through(plan: Any, *, stops_early: bool = False) -> set[str]:
    """Large tables that a plan reads from end to end; along an index it may, if it stops after some rows."""
    if isinstance(plan, str):  # SQLite: SEARCH goes by index
        words = plan.split()
        along = stops_early and "USING INDEX" in plan
        return {words[1]} & LARGE if words[0] == "SCAN" and not along else set()
    if isinstance(plan, list):
        sorts = any(isinstance(part, str) and part.startswith("USE TEMP B-TREE FOR ORDER") for part in plan)
        return set().union(*(read_through(part, stops_early=stops_early and not sorts) for part in plan))
    inner = set().union(*(read_through(part) for part in plan.values() if isinstance(part, list | dict)))
    scanned = {plan["Relation Name"]} if "Seq Scan" in plan.get("Node Type", "") else set()
    return inner | scanned & LARGE
