"""How often things are killed, on which servers, and a summary of what was measured."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from shared.settings import Settings
from tests.faults.service import SHORT_LEASES, TRUE_LEASES, Service, running_service
from tests.servers import postgres_database, redis_server

COUNTS: dict[str, tuple[float, float]] = {
    # what: in `make test`, in `make test-faults`
    "workers killed": (2, 20),
    "pool children killed": (2, 20),
    "killed while counting": (2, 10),
    "jobs queued in the broker": (20, 100),
    "broker away [s]": (3, 30),
    "Postgres killed in mid-commit": (2, 10),
    "Redis frozen [s]": (5, 70),
    "database frozen [s]": (4, 60),
    "last jobs of a stage together": (20, 200),
    "relay killed": (5, 50),
    "cancel against finish": (10, 100),
    "workers restarted": (2, 10),
    "streams cut": (6, 20),
    "applications at once": (10, 100),
    "tasks of each": (10, 100),
}
"""Every number of the fault tests: a few in `make test`, all in `make test-faults`."""

LONGEST_TEST_S = 1500.0
FIGURES = Path(__file__).parents[2] / "out" / "faults.json"
"""What `make test-faults` measured, by test: `python -m benchmarks.reliability` writes it into the page."""
MEASURED = "measured"
BUSY = "test_many_jobs"
"""What keeps every core busy. It begins at once, beside everything that waits for leases and outages."""

Count = Callable[[str], int]
Measured = Callable[[str], None]


def pytest_addoption(parser: pytest.Parser) -> None:
    """`pytest tests/faults --full-faults`."""
    parser.addoption("--full-faults", action="store_true", help="full counts and true lengths: some twenty minutes")


def is_full(config: pytest.Config) -> bool:
    """Whether the full counts were asked for."""
    return bool(config.getoption("--full-faults", default=False))  # unknown when pytest starts from elsewhere


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Longer time-outs for the full counts; what has one true length only runs with them."""
    for item in items:
        if Path(__file__).parent not in item.path.parents:
            continue
        if is_full(config):
            item.add_marker(pytest.mark.timeout(LONGEST_TEST_S))
        elif item.get_closest_marker("true_length"):
            item.add_marker(pytest.mark.skip(reason="takes its true length: make test-faults"))
    if is_full(config):
        items.sort(key=lambda item: not item.name.startswith(BUSY))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """What was measured; after the full counts, in a file too."""
    figures: dict[str, list[str]] = defaultdict(list)
    for report in terminalreporter.getreports("passed"):
        test = report.nodeid.rpartition("::")[2]
        figures[test] += [str(figure) for name, figure in report.user_properties if name == MEASURED]
    told = {test: said for test, said in sorted(figures.items()) if said}
    if told:
        terminalreporter.section("measured")
    for test, said in told.items():
        for figure in said:
            terminalreporter.line(f"{test}: {figure}")
    if told and is_full(config):
        FIGURES.parent.mkdir(exist_ok=True)
        known = json.loads(FIGURES.read_text()) if FIGURES.exists() else {}
        FIGURES.write_text(json.dumps(known | told, indent=2, sort_keys=True))


@pytest.fixture
def count(request: pytest.FixtureRequest) -> Count:
    """A number from `COUNTS`."""
    return lambda what: int(COUNTS[what][is_full(request.config)])


@pytest.fixture
def measured(record_property: Callable[[str, object], None]) -> Measured:
    """Note a figure for the summary."""
    return lambda figure: record_property(MEASURED, figure)


@pytest.fixture(params=["embedded", "postgres and redis"])
def pair(request: pytest.FixtureRequest) -> str:
    """Each pair of servers in turn."""
    return str(request.param)


@pytest.fixture
def service(pair: str, request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Service]:
    """The service on each pair of servers, with short leases and nothing running."""
    with _service(pair, request, tmp_path, SHORT_LEASES) as service:
        yield service


@pytest.fixture
def service_of_production(pair: str, request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Service]:
    """The same with the leases, sweeps and re-sendings of production."""
    with _service(pair, request, tmp_path, TRUE_LEASES) as service:
        yield service


@contextmanager
def _service(pair: str, request: pytest.FixtureRequest, folder: Path, times: dict[str, float]) -> Iterator[Service]:
    home = folder / "home"
    if pair == "embedded":
        with running_service(Settings(home=home, **times)) as service:
            yield service
        return
    with postgres_database(request.getfixturevalue("postgres")) as url, redis_server() as broker:
        settings = Settings(home=home, database_url=url, broker_url=broker.url, **times)
        with running_service(settings, redis=broker if broker.owned else None) as service:
            yield service
