"""Both brokers behind one fixture, and a person's way to read a queue."""

# mypy: allow-untyped-calls

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest
from celery import Celery
from kombu import pools
from kombu.connection import Connection
from kombu.messaging import Consumer

from shared.dispatch.broker import celery_app
from tests.servers import Server, redis_server


@dataclass(frozen=True)
class Broker:
    """A broker, and a queue on it that no other test uses."""

    kind: str
    url: str
    queue: str
    server: Server | None = None

    @property
    def folder(self) -> Path:
        """Folder of the queue, on the embedded broker."""
        return Path(self.url.removeprefix("embedded://")) / self.queue

    @property
    def redis(self) -> Server:
        """The Redis behind it."""
        assert self.server is not None
        return self.server

    def app(self, **options: Any) -> Celery:
        """Make an application for the queue."""
        return celery_app(self.url, queue=self.queue, **options)

    @contextmanager
    def reader(self, prefetch: int = 1, **options: Any) -> Iterator[Reader]:
        """Consume from the queue as a worker does, with acknowledgements and a limit on those that are missing."""
        app = self.app(**options)
        with app.connection_for_read() as connection, connection.channel() as channel:
            channel.basic_qos(0, prefetch, False)
            messages: list[Any] = []
            consumer = Consumer(channel, [app.amqp.queues[self.queue]], on_message=messages.append, accept=["json"])
            with consumer:
                yield Reader(connection, messages)


@dataclass
class Reader:
    """Messages of a queue, one by one."""

    connection: Connection
    messages: list[Any]

    def receive(self, timeout_s: float = 10.0) -> Any:
        """Wait for the next message.

        Raises
        ------
        TimeoutError
            None came.
        """
        if not self.messages:
            self.connection.drain_events(timeout=timeout_s)
        return self.messages.pop(0)

    def ids(self, count: int) -> list[str]:
        """Receive and acknowledge a number of messages, and give the ids they carry."""
        found = []
        for _ in range(count):
            message = self.receive()
            found.append(job_id(message))
            message.ack()
        return found

    def is_empty(self) -> bool:
        """Whether no message comes for a while."""
        try:
            self.messages.append(self.receive(0.5))
        except TimeoutError:
            return True
        return False


def needs_ownership(broker: Broker) -> None:
    """Skip a test that kills or freezes the server, unless it was started for the tests."""
    if not broker.redis.owned:
        pytest.skip("the server in the environment is not ours to kill")


def job_id(message: Any) -> str:
    """Id that a message carries."""
    (identifier,), _, _ = message.payload
    return str(identifier)


@contextmanager
def embedded_broker(folder: Path) -> Iterator[Broker]:
    """Make the embedded broker, in a folder whose name means trouble in a URL."""
    with _connections_closed():
        yield Broker("embedded", f"embedded://{folder / 'a folder; 50%#?'}", "queue")


@contextmanager
def redis_broker(server: Server | None = None) -> Iterator[Broker]:
    """Make a queue of its own on a Redis."""
    queue = f"armature-test-{uuid4().hex}"
    with nullcontext(server) if server is not None else redis_server() as used, _connections_closed():
        yield Broker("redis", used.url, queue, used)


@contextmanager
def _connections_closed() -> Iterator[None]:
    """Close, at the end, what kombu keeps open in its pools; they belong to the process, not to an application."""
    try:
        yield
    finally:
        pools.reset()
