"""Which errors of a database are waited out, and for how long a database may say nothing."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import Engine, text
from sqlalchemy.exc import DBAPIError, OperationalError

from shared.db.engine import POSTGRES_CONNECTION, make_engine
from tests.servers import Server
from worker.patience import for_the_next, passes, patiently


@pytest.fixture
def on_postgres(postgres: Server) -> Iterator[Engine]:
    """An engine on Postgres, which has sessions and a host."""
    engine = make_engine(postgres.url)
    yield engine
    engine.dispose()


def error_of(engine: Engine, statement: str) -> DBAPIError:
    """What a statement fails with."""
    with pytest.raises(DBAPIError) as failed, engine.connect() as connection:
        connection.execute(text(statement))
    return failed.value


def test_what_never_passes_is_raised_at_once(engine: Engine) -> None:
    assert not passes(error_of(engine, "SELECT 1 FROM no_such_table"))
    with pytest.raises(DBAPIError, match="no_such_table"):
        patiently(lambda: error_again(engine), lambda: False)


def error_again(engine: Engine) -> None:
    """A transaction that no waiting heals."""
    with engine.connect() as connection:
        connection.execute(text("SELECT 1 FROM no_such_table"))


def test_a_full_disk_is_named_and_waited_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    engine = make_engine(f"sqlite:///{tmp_path / 'full.db'}")
    with engine.connect() as connection:
        connection.execute(text("CREATE TABLE t (x BLOB)"))
        connection.commit()
        pages = connection.exec_driver_sql("PRAGMA page_count").scalar_one()
        connection.exec_driver_sql(f"PRAGMA max_page_count = {pages}")
        connection.commit()

        def insert() -> int:
            with connection.begin():
                return connection.execute(text("INSERT INTO t VALUES (zeroblob(100000))")).rowcount

        def space_is_made() -> bool:
            connection.exec_driver_sql("PRAGMA max_page_count = 1000000")
            connection.commit()
            return False

        assert patiently(insert, space_is_made) == 1
    engine.dispose()
    assert "the database's disk is full" in "".join(capsys.readouterr())


def test_a_session_ended_by_the_operator_passes(on_postgres: Engine) -> None:
    with on_postgres.connect() as connection, on_postgres.connect() as operator:
        pid = connection.execute(text("SELECT pg_backend_pid()")).scalar_one()
        operator.execute(text("SELECT pg_terminate_backend(:pid)"), {"pid": pid})
        with pytest.raises(DBAPIError) as ended:
            connection.execute(text("SELECT 1"))
        assert passes(ended.value)


def test_a_database_that_does_not_answer_is_given_up() -> None:
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        engine = make_engine(f"postgresql://nobody@127.0.0.1:{silent.getsockname()[1]}/none?connect_timeout=2")
        with pytest.raises(OperationalError, match="timeout") as failed, engine.connect():
            pass
        assert passes(failed.value)
        with pytest.raises(OperationalError):
            patiently(engine.connect, for_the_next(0.0))
        engine.dispose()


def test_a_host_that_vanished_is_noticed(on_postgres: Engine) -> None:
    with on_postgres.connect() as connection:
        driver = connection.connection.driver_connection
        assert driver is not None
        told = driver.info.get_parameters()
        assert {name: told.get(name) for name in POSTGRES_CONNECTION} == {
            name: str(value) for name, value in POSTGRES_CONNECTION.items()
        }
        with socket.socket(fileno=socket.dup(driver.fileno())) as line:
            assert line.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
