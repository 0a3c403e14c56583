"""The whole service on this machine: API, relay and worker, started for the length of a `with` block."""

from __future__ import annotations

import json
import os
import selectors
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import FrameType
from typing import IO

import httpx

from armature.errors import ArmatureError
from armature.supervisor import ProcessSpec
from shared.settings import Settings

LOOPBACK = "127.0.0.1"
START_TIMEOUT_S = 60.0
KILL_AFTER_S = 5.0
"""Added to the drain before a process that has not ended is killed. Jobs it held are taken up again when their leases
have run out."""
_INTERRUPTED = threading.Event()

LAST_WORDS_LINES = 15
LARGEST_LOG_BYTES = 10_000_000


class ServiceError(ArmatureError):
    """The service could not start, or one of its processes ended."""


@dataclass(frozen=True)
class Place:
    """Where the service listens, and how long its processes may take to stop.

    Attributes
    ----------
    host, port
        Of the API; port 0 takes a free one.
    workers
        Solver processes.
    drain_s
        How long solves go on when the service is told to stop, before the worker gives their jobs back [s].
    """

    host: str = LOOPBACK
    port: int = 0
    workers: int = 1
    drain_s: float = 1.0


@dataclass
class Service:
    """A running service."""

    url: str
    logs: Path
    pids: dict[str, int]
    _supervisor: subprocess.Popen[str] = field(repr=False)
    _log_starts: dict[str, int] = field(repr=False)

    def check(self) -> None:
        """Raise `ServiceError`, with the process's last words, when one of the processes has ended.

        Raise `KeyboardInterrupt` when this process was told to end (`interrupt_on_signals`).
        """
        if _INTERRUPTED.is_set():
            raise KeyboardInterrupt
        if self._supervisor.poll() is None and not _readable(self._supervisor.stdout):
            return
        report = _read_report(self._supervisor)
        name = str(report.get("name", "supervisor"))
        code = report.get("exit_code", self._supervisor.poll())
        raise ServiceError(f"the {name} process ended ({_ending(code)})\n{self._last_words(name)}".rstrip())

    def wait_until_ready(self) -> None:
        """Return as soon as the API says that database and broker are there."""
        deadline = time.monotonic() + START_TIMEOUT_S
        state = "no answer"
        while time.monotonic() < deadline:
            self.check()
            with suppress(httpx.TransportError):
                answer = httpx.get(f"{self.url}/readyz", timeout=5.0)
                if answer.is_success:
                    return
                state = answer.text
            time.sleep(0.05)
        raise ServiceError(f"the service is not ready after {START_TIMEOUT_S:g} s: {state}; logs are in {self.logs}")

    def queued_jobs(self) -> int:
        """Jobs that wait for a worker."""
        return int(httpx.get(f"{self.url}/readyz", timeout=5.0).json().get("queued_jobs", 0))

    def _last_words(self, name: str) -> str:
        path = self.logs / f"{name}.log"
        if not path.exists():
            return ""
        with path.open("rb") as log:
            log.seek(self._log_starts.get(name, 0))
            lines = log.read().decode(errors="replace").splitlines()
        said = "\n".join(f"  {line}" for line in lines[-LAST_WORDS_LINES:])
        return f"{said}\nall of it is in {path}" if said else f"it printed nothing to {path}"


@contextmanager
def running_service(settings: Settings, place: Place) -> Iterator[Service]:
    """Start the service, wait until it is ready, and stop it at the end, whatever the end is.

    The database is brought to its newest revision first. Nothing outlives this process (`armature.supervisor`).

    Raises
    ------
    ServiceError
        Something did not start; the message has the process's own words.
    """
    logs = settings.home / "logs"
    logs.mkdir(parents=True, exist_ok=True)
    _migrate(settings)
    port = place.port or _free_port(place.host)
    _refuse_taken_port(place.host, port)
    specs = _specs(place, port, logs)
    log_starts = {spec.name: _log_start(Path(spec.log)) for spec in specs}
    with _supervised(specs, settings, place) as supervisor:
        url = f"http://{_reachable(place.host)}:{port}"
        service = Service(url, logs, {}, supervisor, log_starts)
        service.pids |= {name: int(str(pid)) for name, pid in _read_report(supervisor).items()}
        service.wait_until_ready()
        yield service


def _migrate(settings: Settings) -> None:
    # Imported here: half a second that commands which only ask a server should not wait for.
    from sqlalchemy.exc import SQLAlchemyError

    from shared.db.migrate import upgrade

    try:
        upgrade(settings.database_url)
    except SQLAlchemyError as error:
        raise ServiceError(f"the database cannot be prepared: {getattr(error, 'orig', error)}") from error


def _specs(place: Place, port: int, logs: Path) -> list[ProcessSpec]:
    """Processes in the order in which they stop: the worker first, while those it talks to are there."""
    modules = {
        "worker": ["worker.main"],
        "relay": ["worker.relay"],
        "api": ["api.main", "--host", place.host, "--port", str(port)],
    }
    return [
        ProcessSpec(name, [sys.executable, "-m", *module], str(logs / f"{name}.log"), place.drain_s + KILL_AFTER_S)
        for name, module in modules.items()
    ]


@contextmanager
def _supervised(specs: list[ProcessSpec], settings: Settings, place: Place) -> Iterator[subprocess.Popen[str]]:
    supervisor = subprocess.Popen(
        [sys.executable, "-m", "armature.supervisor"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, **_environment(settings, place)},
        start_new_session=True,
    )
    try:
        assert supervisor.stdin is not None
        supervisor.stdin.write(json.dumps([asdict(spec) for spec in specs]) + "\n")
        supervisor.stdin.flush()
        yield supervisor
    finally:
        _close(supervisor)


def _environment(settings: Settings, place: Place) -> Mapping[str, str]:
    return {
        "ARMATURE_HOME": str(settings.home),
        "ARMATURE_DATABASE_URL": settings.database_url,
        "ARMATURE_BROKER_URL": settings.broker_url,
        "ARMATURE_WORKERS": str(place.workers),
        "ARMATURE_DRAIN_S": str(place.drain_s),
    }


def _close(supervisor: subprocess.Popen[str]) -> None:
    """Close its pipe, which stops everything in order; a second Ctrl-C stops it at once."""
    assert supervisor.stdin is not None
    with suppress(BrokenPipeError):
        supervisor.stdin.close()
    while True:
        try:
            supervisor.wait()
        except KeyboardInterrupt:
            supervisor.terminate()
        else:
            break
    if supervisor.stdout is not None:
        supervisor.stdout.close()


def _readable(stream: IO[str] | None) -> bool:
    if stream is None:
        return False
    with selectors.DefaultSelector() as selector:
        selector.register(stream, selectors.EVENT_READ)
        return bool(selector.select(timeout=0))


def _read_report(supervisor: subprocess.Popen[str]) -> dict[str, object]:
    """The next line that the supervisor writes; empty when it ended without a word."""
    assert supervisor.stdout is not None
    line = supervisor.stdout.readline()
    return dict(json.loads(line)) if line.strip() else {}


def _ending(code: object) -> str:
    if isinstance(code, int) and code < 0:
        return f"signal {-code}"
    return f"exit code {code}"


def _log_start(log: Path) -> int:
    """Where this run's output begins in a log; a log that has grown large is put aside first."""
    if not log.exists():
        return 0
    if log.stat().st_size > LARGEST_LOG_BYTES:
        log.replace(log.with_suffix(".log.1"))
        return 0
    return log.stat().st_size


def _free_port(host: str) -> int:
    with socket.socket() as probe:
        probe.bind((host, 0))
        return int(probe.getsockname()[1])


def _refuse_taken_port(host: str, port: int) -> None:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise ServiceError(
                f"port {port} of {host} cannot be used ({error.strerror}); --port takes another"
            ) from None


def _reachable(host: str) -> str:
    """The address under which this machine reaches a server that listens on `host`."""
    return LOOPBACK if host in ("0.0.0.0", "") else host


def interrupt_on_signals() -> None:
    """Make SIGTERM and SIGHUP of this process mean what Ctrl-C means, so that `with` blocks end in order.

    Python drops an exception that comes inside a destructor. Such an interruption is remembered, and raised by the next
    `Service.check`.
    """

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        _INTERRUPTED.set()
        raise KeyboardInterrupt

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, interrupt)
