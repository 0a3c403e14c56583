"""The service on one pair of servers, its processes started, killed and frozen by a test."""

from __future__ import annotations

import multiprocessing
import os
import signal
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.context import ForkServerProcess

import httpx
from sqlalchemy import Engine, func, select

from services.jobs.submit import submit
from shared.contracts.application import ApplicationRequest
from shared.db.engine import make_engine, reading
from shared.db.migrate import upgrade
from shared.db.tables import Application, Job
from shared.domain import ApplicationState, JobState
from shared.settings import Settings
from tests.faults import roles
from tests.servers import Server, descendants, free_port
from tests.service.requests import HOME, POSE

RECOVERY_S = 60.0
"""What is promised: whatever was lost is under way again within this time."""
START_S = 60.0
"""A process that does not work after so long never will, on however busy a machine."""
POLL_S = 0.02
"""How often a test looks whether something has happened."""

SHORT_LEASES = {
    "lease_s": 1.5, "heartbeat_s": 0.3, "cancel_poll_s": 0.1, "sweep_s": 0.3, "resend_after_s": 1.5, "workers": 2,
    "rate_per_minute": 0,
}  # fmt: skip
"""The defaults divided by about thirty. On a busy machine a lease may be lost to a delay; that costs an attempt, and
where attempts are counted leases are longer."""
TRUE_LEASES = {"workers": 2, "rate_per_minute": 0}
"""The defaults: 45 s of lease, a heartbeat every 10 s, a sweep every 5 s, sent again after 30 s."""

# Forking from a process that has imported everything saves two seconds of processor time at each of hundreds of starts.
_processes = multiprocessing.get_context("forkserver")
_processes.set_forkserver_preload(["tests.faults.roles"])


def moves(count: int = 3, **changes: object) -> ApplicationRequest:
    """An application of some tasks."""
    tasks = [{"start_rad": POSE, "end_rad": HOME, "payload_kg": 0.01 * k} for k in range(count)]
    return ApplicationRequest.model_validate({"name": "moves", "tasks": tasks, **changes})


@dataclass
class Service:
    """One database and one broker, and processes of the service on them."""

    settings: Settings
    postgres: Server | None = None
    """Set when the test may kill it."""
    redis: Server | None = None
    engine: Engine = field(init=False)
    accepted: list[str] = field(default_factory=list)
    """Applications whose acceptance was acknowledged."""
    _started: list[ForkServerProcess] = field(default_factory=list)

    _clients: list[httpx.Client] = field(default_factory=list)

    def __post_init__(self) -> None:
        upgrade(self.settings.database_url)
        self.engine = make_engine(self.settings.database_url)
        self.settings.home.mkdir(exist_ok=True)
        self.solves_take(0.0)

    def start(self, role: str, **environment: str) -> ForkServerProcess:
        """Start a process (`roles.ROLES`)."""
        given = {f"ARMATURE_{name.upper()}": str(value) for name, value in self.settings.model_dump().items()}
        process = _processes.Process(target=roles.start, args=(role, given | environment), name=role)
        process.start()
        self._started.append(process)
        return process

    def start_api(self, **environment: str) -> httpx.Client:
        """Start the API, and give a client of it when it answers."""
        port = str(free_port())
        self.start("api", ARMATURE_TEST_PORT=port, **environment)
        unlimited = httpx.Limits(max_connections=None)
        client = httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=START_S, limits=unlimited)
        self._clients.append(client)
        wait_until(lambda: answers(client), START_S)
        return client

    def latest(self, role: str) -> ForkServerProcess:
        """The process of a role that was started last."""
        return next(process for process in reversed(self._started) if process.name == role)

    def solves_take(self, seconds: float) -> None:
        """From now on, those at hand too."""
        (self.settings.home / roles.SOLVE_S).write_text(f"{seconds}")

    def kill_process_of_task(self, index: int) -> None:
        """Let the co-design of a task kill its process, whenever it is tried."""
        (self.settings.home / roles.DEADLY_TASK).write_text(str(index))

    def raise_in_task(self, index: int) -> None:
        """Let the co-design of a task raise an exception, whenever it is tried."""
        (self.settings.home / roles.RAISING_TASK).write_text(str(index))

    def kill_when_counting(self) -> None:
        """Let a process be killed between the counter of a stage and its commit, once."""
        (self.settings.home / roles.DEATH).touch()

    def executions(self) -> list[str]:
        """One entry for each solve that was begun."""
        return (self.settings.home / roles.EXECUTIONS).read_text().splitlines()

    def submit(self, tasks: int = 3) -> str:
        """Submit an application past the API."""
        application_id, _ = submit(self.engine, self.settings, moves(tasks))
        self.accepted.append(application_id)
        return application_id

    def held(self) -> list[Held]:
        """Jobs that are running, and by whom."""
        columns = select(Job.id, Job.token, Job.worker).where(Job.state == JobState.RUNNING)
        with reading(self.engine) as session:
            return [Held(row.id, row.token, int(row.worker.rpartition(":")[2])) for row in session.execute(columns)]

    def unfinished(self) -> int:
        """Count the applications that are not final."""
        final = [state for state in ApplicationState if state.final]
        with reading(self.engine) as session:
            return session.scalar(select(func.count()).where(Application.state.not_in(final))) or 0

    def wait_for_the_end(self, within_s: float = RECOVERY_S, every_s: float = POLL_S) -> None:
        """Wait until every application is final, looking `every_s`."""
        wait_until(lambda: not self.unfinished(), within_s, every_s=every_s)

    def close(self) -> None:
        """End everything that was started."""
        for client in self._clients:
            client.close()
        for process in self._started:
            kill_family(process)
        self.engine.dispose()


@dataclass(frozen=True)
class Held:
    """A claim, as the database shows it."""

    job_id: str
    token: int
    process: int


@contextmanager
def running_service(
    settings: Settings, postgres: Server | None = None, redis: Server | None = None
) -> Iterator[Service]:
    """A service with nothing running yet."""
    service = Service(settings, postgres, redis)
    try:
        yield service
    finally:
        service.close()


def kill_family(process: ForkServerProcess) -> None:
    """SIGKILL to a process and all its children."""
    signal_family(process, signal.SIGKILL)
    process.join()


def signal_family(process: ForkServerProcess, number: signal.Signals) -> None:
    """A signal to a process and all its children, so that the children cannot notice the parent's end."""
    if process.pid is None or not process.is_alive():
        return
    for pid in [process.pid, *descendants(process.pid)]:
        with suppress(ProcessLookupError):
            os.kill(pid, number)


def answers(client: httpx.Client) -> bool:
    """Whether an API is up."""
    try:
        return client.get("/livez").is_success
    except httpx.TransportError:
        return False


def wait_until(
    holds: Callable[[], object], within_s: float, since: float | None = None, every_s: float = POLL_S
) -> None:
    """Wait for something that has to hold `within_s` of now, or of `since` (by `time.monotonic`)."""
    deadline = (time.monotonic() if since is None else since) + within_s
    while not holds():
        assert time.monotonic() < deadline, f"not within {within_s:g} s"
        time.sleep(every_s)


def spread(seconds: list[float]) -> str:
    """Median and maximum, for a person."""
    return f"median {statistics.median(seconds):.1f} s, longest {max(seconds):.1f} s"


def percentile_95(seconds: list[float]) -> float:
    """What 95 of 100 do not exceed."""
    return statistics.quantiles(seconds, n=20, method="inclusive")[-1]
