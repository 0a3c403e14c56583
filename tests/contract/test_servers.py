"""The servers that other tests stand on do start, answer, and survive what those tests do to them."""

from __future__ import annotations

import psycopg
import pytest
import redis

from tests.servers import Server, postgres_database, postgres_server, redis_server


def test_redis_answers() -> None:
    with redis_server() as server, redis.Redis.from_url(server.url) as client:
        assert client.ping()


def test_postgres_answers() -> None:
    with postgres_server() as server, postgres_database(server) as url, psycopg.connect(url) as connection:
        assert connection.execute("SELECT 1").fetchone() == (1,)


def test_redis_with_append_only_file_keeps_its_data_when_killed() -> None:
    with redis_server("--appendonly", "yes", "--appendfsync", "always") as server:
        needs_ownership(server)
        with redis.Redis.from_url(server.url) as client:
            client.set("key", "value")
        server.kill()
        server.start()
        with redis.Redis.from_url(server.url) as client:
            assert client.get("key") == b"value"


def test_postgres_keeps_what_was_committed_when_killed() -> None:
    with postgres_server(fsync=True) as server:
        needs_ownership(server)
        with psycopg.connect(server.url, autocommit=True) as connection:
            connection.execute("CREATE TABLE kept AS SELECT 1 AS number")
        server.kill()
        server.start()
        with psycopg.connect(server.url) as connection:
            assert connection.execute("SELECT number FROM kept").fetchone() == (1,)


@pytest.mark.parametrize("run", [redis_server, postgres_server])
def test_a_frozen_server_does_not_answer_until_thawed(run) -> None:  # type: ignore[no-untyped-def]
    with run() as server:
        needs_ownership(server)
        server.freeze()
        with pytest.raises((redis.TimeoutError, psycopg.OperationalError)):
            server.answers(server.url)
        server.thaw()
        server.answers(server.url)


def needs_ownership(server: Server) -> None:
    if not server.owned:
        pytest.skip("the server in the environment is not ours to kill")
