"""Fixtures that several kinds of tests share."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import Engine

from services.codesign.kernels import default_cache
from shared.db.engine import make_engine
from shared.db.migrate import upgrade
from shared.settings import Settings
from tests.servers import Server, postgres_database, postgres_server, redis_server

os.environ.setdefault("OMP_NUM_THREADS", "1")


def home_with_kernels(folder: Path) -> Path:
    """An empty ARMATURE_HOME, but for the compiled kernels of this machine."""
    cache = default_cache()
    cache.mkdir(parents=True, exist_ok=True)
    folder.mkdir()
    (folder / "kernels").symlink_to(cache)
    return folder


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """An ARMATURE_HOME that needs no compiling."""
    return home_with_kernels(tmp_path / "home")


@pytest.fixture(scope="session")
def redis() -> Iterator[Server]:
    """One Redis server for all tests."""
    with redis_server() as server:
        yield server


@pytest.fixture(scope="session")
def postgres() -> Iterator[Server]:
    """One Postgres server for all tests."""
    with postgres_server() as server:
        yield server


@pytest.fixture(params=["sqlite", "postgres"])
def database_url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """An empty database, SQLite and Postgres in turn."""
    if request.param == "sqlite":
        yield f"sqlite:///{tmp_path / 'armature.db'}"
        return
    with postgres_database(request.getfixturevalue("postgres")) as url:
        yield url


@pytest.fixture
def settings(database_url: str, tmp_path: Path) -> Settings:
    """Settings for a database with all tables."""
    upgrade(database_url)
    return Settings(home=tmp_path / "home", database_url=database_url)


@pytest.fixture
def engine(settings: Settings) -> Iterator[Engine]:
    """An engine on that database."""
    engine = make_engine(settings.database_url)
    yield engine
    engine.dispose()
