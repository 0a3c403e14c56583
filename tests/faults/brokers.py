"""What can happen to the broker of either pair: it loses its queue, or is away for a while."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol
from uuid import uuid4

import pytest
import redis

from shared.dispatch.broker import QUEUE
from shared.settings import Settings
from tests.servers import Server


class Broker(Protocol):
    """A broker that a test may break."""

    def queued(self) -> int:
        """Count the messages that wait for a worker."""

    def lose(self) -> None:
        """Forget every message."""

    def go_away(self) -> None:
        """Be there for nobody; what was queued is lost."""

    def come_back(self) -> None:
        """Be there again, empty."""


@dataclass(frozen=True)
class RedisBroker:
    """A Redis that keeps nothing on disk."""

    server: Server

    def queued(self) -> int:
        """Length of its list."""
        with redis.Redis.from_url(self.server.url) as client:
            return int(client.llen(QUEUE))

    def lose(self) -> None:
        """Killed and started again."""
        self.go_away()
        self.come_back()

    def go_away(self) -> None:
        """Killed."""
        self.server.kill()

    def come_back(self) -> None:
        """Started again on its port."""
        self.server.start()


@dataclass(frozen=True)
class FolderBroker:
    """The embedded broker's folder."""

    folder: Path

    def queued(self) -> int:
        """Files that are ready."""
        return len(list((self.folder / QUEUE / "new").glob("*.msg")))

    def lose(self) -> None:
        """Deleted, with everything in it."""
        lost = self.folder.rename(self.folder.with_name(f"lost-{uuid4().hex}"))  # at once: others may make it anew
        shutil.rmtree(lost)

    def go_away(self) -> None:
        """A file stands where the folder was, so that nobody can make it anew."""
        while True:
            self.lose()
            try:
                self.folder.write_text("not a folder")
            except IsADirectoryError:
                continue  # somebody was faster
            return

    def come_back(self) -> None:
        """Nothing stands in the way any more."""
        self.folder.unlink()


def broker_of(settings: Settings, redis_server: Server | None) -> Broker:
    """The broker of a service; a server of the environment must not be broken."""
    if settings.broker_url.startswith("embedded://"):
        return FolderBroker(Path(settings.broker_url.removeprefix("embedded://")))
    if redis_server is None:
        pytest.skip("the broker of the environment must not be killed")
    return RedisBroker(redis_server)
