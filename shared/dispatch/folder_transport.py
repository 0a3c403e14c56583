"""A broker that needs no server: kombu's virtual transport over a folder of files.

`embedded:///path/of/a/folder` names it. Each queue is a `MessageFolder` inside. Bindings between exchanges and queues
live in the memory of each connection, as kombu keeps them: a producer declares the queue it sends to, so there is
nothing to share. Broadcasts (remote control, events) have no meaning here and go nowhere.

Like the Redis transport it belongs to Celery's event loop, so a worker is the same program over both: the loop looks
into the folder every `polling_interval` seconds, and at once when an acknowledgement makes room for another message.
"""

# kombu's own methods carry no types.
# mypy: allow-untyped-calls

from __future__ import annotations

import logging
import os
import time
from pathlib import Path
from queue import Empty
from typing import Any, ClassVar
from urllib.parse import quote

from kombu.transport import virtual
from kombu.utils.json import dumps, loads

from shared.dispatch.message_folder import MessageFolder

logger = logging.getLogger(__name__)

SCHEME = "embedded"
POLLING_INTERVAL_S = 0.05
VISIBILITY_TIMEOUT_S = 3600.0
# Looking for expired claims costs one listing; how late after its time-out a message returns is of no consequence.
EXPIRY_CHECKS_PER_TIMEOUT = 10
# A consumer without a prefetch limit must still return to its event loop now and then.
DELIVERIES_PER_LOOK = 100


def folder_url(folder: Path) -> str:
    """Broker URL of a folder, with everything quoted that means something else in a URL."""
    path = folder.absolute().as_posix()
    return f"{SCHEME}:///{quote(path.removeprefix('/'), safe='/:')}"


class QoS(virtual.QoS):
    """Bookkeeping of unacknowledged messages, whose files change with it."""

    def ack(self, delivery_tag: str) -> None:
        """Delete the message, and use the room it leaves."""
        self.channel.forget(delivery_tag)
        super().ack(delivery_tag)

    def reject(self, delivery_tag: str, requeue: bool = False) -> None:
        """Put the message back, or delete it."""
        if requeue:
            self.channel.put_back(delivery_tag)
        self.ack(delivery_tag)


class Channel(virtual.Channel):
    """A channel whose queues are folders."""

    QoS = QoS
    from_transport_options: Any = (*virtual.Channel.from_transport_options, "visibility_timeout")
    visibility_timeout = VISIBILITY_TIMEOUT_S

    def __init__(self, connection: Any, **kwargs: Any) -> None:
        self._queues: dict[str, MessageFolder] = {}
        self._next_expiry_check = 0.0
        self._root: Path = connection.folder
        super().__init__(connection, **kwargs)

    def forget(self, delivery_tag: str) -> None:
        """Delete a claimed message, and let the transport look for the next."""
        queue, claimed = self._claim_of(delivery_tag)
        queue.acknowledge(claimed)
        if self.connection is not None:
            self.connection.look_soon()

    def put_back(self, delivery_tag: str) -> None:
        """Make a claimed message ready again."""
        queue, claimed = self._claim_of(delivery_tag)
        queue.put_back(claimed)

    def basic_consume(self, queue: str, no_ack: bool, callback: Any, consumer_tag: str, **kwargs: Any) -> None:
        """Consume from a queue; without acknowledgements a message is gone once it is handed over."""

        def hand_over(message: Any) -> Any:
            if no_ack:
                self.forget(message.delivery_tag)
            return callback(message)

        super().basic_consume(queue, no_ack, hand_over, consumer_tag, **kwargs)

    def basic_get(self, queue: str, no_ack: bool = False, **kwargs: Any) -> Any:
        """Get one message now, or None."""
        message = super().basic_get(queue, no_ack=no_ack, **kwargs)
        if message is not None and no_ack:
            self.forget(message.delivery_tag)
        return message

    def _put(self, queue: str, message: dict[str, Any], **_: Any) -> None:
        self._queue(queue).put(dumps(message).encode())

    def _get(self, queue: str, timeout: Any = None) -> dict[str, Any]:  # noqa: ARG002
        folder = self._queue(queue)
        self._put_back_expired(folder)
        while (claimed := folder.claim()) is not None:
            try:
                message: dict[str, Any] = loads(claimed.read_bytes())
                # A tag that names the claim finds the file again with no table to keep, and is unique even if
                # somebody copied a message file.
                message["properties"]["delivery_tag"] = f"{queue}/{claimed.name}"
                self.Message(message, channel=self)  # raises on whatever a consumer could stumble over
            except FileNotFoundError:
                continue  # the claim expired while this process stood still
            except Exception:
                # Whatever is wrong with one file must not end the worker: it would end the next one too.
                logger.warning("refused a message that cannot be read: %s", claimed, exc_info=True)
                folder.refuse(claimed)
                continue
            return message
        raise Empty

    def _restore(self, message: Any) -> None:
        self.put_back(message.delivery_tag)

    def _size(self, queue: str) -> int:
        return self._queue(queue).size()

    def _purge(self, queue: str) -> int:
        return self._queue(queue).purge()

    def _new_queue(self, queue: str, **_: Any) -> None:
        self._queue(queue).create()

    def _has_queue(self, queue: str, **_: Any) -> bool:
        return self._folder(queue).is_dir()

    def _queue(self, queue: str) -> MessageFolder:
        if queue not in self._queues:
            self._queues[queue] = MessageFolder(self._folder(queue))
        return self._queues[queue]

    def _folder(self, queue: str) -> Path:
        # Quoting, dots included, keeps a queue's folder inside the broker's, whatever the queue is called.
        return self._root / quote(queue, safe="").replace(".", "%2E")

    def _claim_of(self, delivery_tag: str) -> tuple[MessageFolder, Path]:
        queue, _, name = delivery_tag.rpartition("/")
        folder = self._queue(queue)
        return folder, folder.claimed(name)

    def _put_back_expired(self, folder: MessageFolder) -> None:
        if time.monotonic() < self._next_expiry_check:
            return
        self._next_expiry_check = time.monotonic() + self.visibility_timeout / EXPIRY_CHECKS_PER_TIMEOUT
        if count := folder.put_back_expired(self.visibility_timeout):
            logger.warning("put back %d messages whose consumer never acknowledged them", count)


class Transport(virtual.Transport):
    """The embedded broker, as kombu sees it."""

    Channel = Channel
    cycle: Any
    driver_type = SCHEME
    driver_name = "folder"
    default_connection_params: ClassVar[dict[str, Any]] = {}  # no host, no port: kombu warns when one is missing
    polling_interval = POLLING_INTERVAL_S
    # Trouble with the folder is trouble with the broker: Celery then reconnects with its back-off.
    connection_errors: Any = (*virtual.Transport.connection_errors, OSError)
    implements = virtual.Transport.implements.extend(asynchronous=True, exchange_type=frozenset(["direct"]))

    def __init__(self, client: Any, **kwargs: Any) -> None:
        super().__init__(client, **kwargs)
        self.folder = _folder_of(client.virtual_host)
        self._loop: Any = None
        self._ticks: Any = None

    def driver_version(self) -> str:
        """Version of the format on disk."""
        return "1"

    def establish_connection(self) -> Any:
        """Make sure the folder is there and can be written to."""
        # Whoever can write here can start tasks by name, so it is made for its owner only.
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not os.access(self.folder, os.R_OK | os.W_OK | os.X_OK):
            raise PermissionError(f"the broker's folder cannot be written to: {self.folder}")
        return super().establish_connection()

    def close_connection(self, connection: Any) -> None:
        """Close every channel; what they had not acknowledged goes back."""
        if self._ticks is not None:
            self._ticks.cancel()
        self._loop = self._ticks = None
        super().close_connection(connection)

    def register_with_event_loop(self, connection: Any, loop: Any) -> None:  # noqa: ARG002
        """Look for messages from Celery's event loop."""
        self._loop = loop
        self._ticks = loop.call_repeatedly(self.polling_interval, self._look)

    def look_soon(self) -> None:
        """Look for messages in this round of the event loop: there is room for one more."""
        if self._loop is not None:
            self._loop.call_later(0, self._look)

    def _look(self) -> None:
        for _ in range(DELIVERIES_PER_LOOK):
            try:
                self.cycle.get(self._deliver)
            except Empty:
                return


def _folder_of(virtual_host: str) -> Path:
    """Folder of a broker URL; kombu has cut the first slash of the path off."""
    path = Path(virtual_host)
    if not path.is_absolute():
        path = Path("/", virtual_host)
    if path == Path(path.anchor):
        raise ValueError(f"an {SCHEME} broker needs a folder in its URL: {SCHEME}:///path/of/a/folder")
    return path
