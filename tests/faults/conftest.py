"""How often things are killed, on which servers, and a summary of what was measured."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from shared.settings import Settings
from tests.faults.service import SHORT_LEASES, Service, running_service
from tests.servers import postgres_database, redis_server

COUNTS: dict[str, tuple[float, float]] = {
    # what: in `make test`, in `make test-faults`
    "workers killed": (2, 20),
    "pool children killed": (2, 20),
    "jobs queued in Redis": (20, 100),
    "Redis down [s]": (3, 30),
    "Postgres killed in mid-commit": (2, 10),
    "Redis frozen [s]": (5, 70),
    "Postgres frozen [s]": (4, 60),
    "last jobs of a stage together": (20, 200),
    "relay killed": (5, 50),
    "cancel against finish": (10, 100),
    "workers restarted": (2, 10),
    "applications at once": (10, 100),
    "tasks of each": (10, 100),
}
"""Every number of the fault tests: a few in `make test`, all in `make test-faults`."""

LONGEST_TEST_S = 900.0

Count = Callable[[str], int]
Measured = Callable[[str], None]

_measured = pytest.StashKey[list[str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """`pytest tests/faults --full-faults`."""
    parser.addoption("--full-faults", action="store_true", help="full counts and true lengths: a quarter of an hour")


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


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """What was measured."""
    lines = config.stash.get(_measured, [])
    if lines:
        terminalreporter.section("measured")
        for line in lines:
            terminalreporter.line(line)


@pytest.fixture
def count(request: pytest.FixtureRequest) -> Count:
    """A number from `COUNTS`."""
    return lambda what: int(COUNTS[what][is_full(request.config)])


@pytest.fixture
def measured(request: pytest.FixtureRequest) -> Measured:
    """Note a figure for the summary."""
    lines = request.config.stash.setdefault(_measured, [])
    return lambda figure: lines.append(f"{request.node.name}: {figure}")


@pytest.fixture(params=["embedded", "postgres and redis"])
def service(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Service]:
    """The service on each pair of servers, with short leases and nothing running."""
    home = tmp_path / "home"
    if request.param == "embedded":
        with running_service(Settings(home=home, **SHORT_LEASES)) as service:
            yield service
        return
    with postgres_database(request.getfixturevalue("postgres")) as url, redis_server() as broker:
        settings = Settings(home=home, database_url=url, broker_url=broker.url, **SHORT_LEASES)
        with running_service(settings, redis=broker if broker.owned else None) as service:
            yield service
