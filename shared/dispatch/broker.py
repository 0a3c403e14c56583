"""The Celery application of every process, and the one thing that is ever sent: the id of a job.

The database is the truth and a message is only a wake-up, so everything Celery can remember about a task (results,
events, retries, revocations) is switched off. What is left is a queue of ids with late acknowledgement.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from celery import Celery
from celery.utils import uuid
from kombu.connection import Connection
from kombu.exceptions import BatchPublishError, OperationalError
from kombu.transport import TRANSPORT_ALIASES

from shared.dispatch.folder_transport import SCHEME, folder_url

QUEUE = "armature"
# Far above the longest job: the sweep of the database re-sends a lost job within minutes, so a time-out of the broker
# is only the last resort, and one shorter than a job would start that job again while it runs.
VISIBILITY_TIMEOUT_S = 6 * 3600.0
# Longest wait for an answer of Redis before it counts as gone.
SOCKET_TIMEOUT_S = 5.0
# A sender is told at once that the broker is away: the message is in the outbox, and the relay has its own patience.
# (A worker waits for its broker for ever, whatever stands here.)
FAIL_AT_ONCE = {"max_retries": 0, "interval_start": 0, "interval_step": 0, "interval_max": 0}


def celery_app(
    broker_url: str,
    *,
    name: str = "armature",
    queue: str = QUEUE,
    task_modules: Sequence[str] = (),
    visibility_timeout_s: float = VISIBILITY_TIMEOUT_S,
) -> Celery:
    """Make the Celery application for a broker.

    Parameters
    ----------
    broker_url
        `embedded://FOLDER`, the folder being an absolute path taken as it stands, or a URL of kombu's (`redis://...`).
    name
        Name of the application, in logs.
    queue
        The one queue that is sent to and consumed from.
    task_modules
        For a worker: modules that define its tasks with `celery.shared_task`. Where the pool's processes are not forked
        (macOS) they get a copy of the configuration only, and find the tasks by importing these; a task that was added
        to the application itself is unknown to them.
    visibility_timeout_s
        Age of an unacknowledged message [s] at which it is delivered again.

    Returns
    -------
    Celery
        An application; nothing is connected, and it does not become anybody's default.

    Raises
    ------
    ValueError
        The URL names no folder.
    """
    TRANSPORT_ALIASES[SCHEME] = "shared.dispatch.folder_transport:Transport"
    embedded = broker_url.startswith(f"{SCHEME}:")
    url = _embedded_url(broker_url) if embedded else broker_url
    app = Celery(name, broker=url, set_as_current=False)
    app.conf.update(
        # An environment variable of Celery's must not send part of the traffic elsewhere.
        broker_read_url=url,
        broker_write_url=url,
        broker_transport_options=_transport_options(visibility_timeout_s, embedded=embedded),
        broker_connection_retry_on_startup=True,
        broker_connection_max_retries=None,  # a worker outlives any outage of its broker
        include=list(task_modules),
        task_default_queue=queue,
        task_create_missing_queues=False,
        # Acknowledged when the job is done. A worker that dies leaves its message to the time-out; it is not put back
        # at once, because a job that kills its process would come back for ever: the database counts attempts.
        task_acks_late=True,
        task_reject_on_worker_lost=False,
        task_acks_on_failure_or_timeout=True,
        worker_prefetch_multiplier=1,
        worker_disable_prefetch=not embedded,
        # A solve goes on while the broker is away: its lease is in the database.
        worker_cancel_long_running_tasks_on_connection_loss=False,
        task_ignore_result=True,
        task_store_errors_even_if_ignored=False,
        result_backend=None,
        worker_enable_remote_control=False,
        worker_send_task_events=False,
        task_send_sent_event=False,
        task_serializer="json",
        accept_content=["json"],
        worker_hijack_root_logger=False,
        worker_redirect_stdouts=False,
        enable_utc=True,
    )
    return app


def send(app: Celery, task_name: str, *job_ids: str | int) -> None:
    """Wake some worker up for each of some jobs.

    The messages are Celery's own (protocol 2), made without what it does for each beside: routes, signals, traces. They
    go to the queue by its name, in one round trip where the broker takes several at once.

    Parameters
    ----------
    app
        From `celery_app`.
    task_name
        Name of the task; the sender does not import it.
    job_ids
        Ids of the jobs in the database. A message holds one, and nothing else.

    Raises
    ------
    kombu.exceptions.OperationalError
        The broker did not confirm the messages, and may or may not have each. Whoever keeps the outbox sends them
        again.
    """
    queue = app.amqp.queues[app.conf.task_default_queue]
    with app.producer_or_acquire() as producer, _one_error(producer.connection), producer.batch():
        for job_id in job_ids:
            message = app.amqp.create_task_message(uuid(), task_name, [job_id], {}, argsrepr=repr(job_id))
            address = {"exchange": "", "routing_key": queue.name, "declare": [queue]}
            producer.publish(message.body, headers=message.headers, serializer="json", **address, **message.properties)


@contextmanager
def _one_error(connection: Connection) -> Iterator[None]:
    """A broker that is away, whichever it is, and however much was sent at once."""
    try:
        yield
    except (*connection.connection_errors, *connection.channel_errors, BatchPublishError) as error:
        raise OperationalError(str(error)) from error


def broker_reachable(app: Celery, timeout_s: float = 2.0) -> bool:
    """Tell whether the broker answers.

    Parameters
    ----------
    app
        From `celery_app`.
    timeout_s
        Longest wait for one answer [s].

    Returns
    -------
    bool
        Whether a connection was made and the broker answered on it.
    """
    options = {"socket_timeout": timeout_s, "socket_connect_timeout": timeout_s}
    with app.connection_for_write(connect_timeout=timeout_s, transport_options=options) as connection:
        try:
            connection.ensure_connection(**FAIL_AT_ONCE)
        except OperationalError:
            return False
    return True


def queue_size(app: Celery) -> int:
    """Count the messages that wait for a worker.

    Raises
    ------
    kombu.exceptions.OperationalError
        The broker cannot be reached.
    """
    with app.connection_for_write() as connection, _one_error(connection):
        return int(connection.default_channel.queue_declare(app.conf.task_default_queue).message_count)


def worker_arguments(
    concurrency: int, *, memory_mb: int | None = None, hostname: str = "armature@%h", loglevel: str = "WARNING"
) -> list[str]:
    """Arguments of `app.worker_main` that start a worker, the same over every broker.

    Gossip, mingle and heartbeats are conversations between workers; the database knows which of them live. A process
    that has held more than `memory_mb` is replaced between two tasks.
    """
    limits = [] if memory_mb is None else [f"--max-memory-per-child={1000 * memory_mb}"]  # kB
    return [
        "worker",
        *limits,
        f"--concurrency={concurrency}",
        "--pool=prefork",
        "--prefetch-multiplier=1",
        "--without-gossip",
        "--without-mingle",
        "--without-heartbeat",
        f"--hostname={hostname}",
        f"--loglevel={loglevel}",
    ]


def _embedded_url(broker_url: str) -> str:
    folder = Path(broker_url.removeprefix(f"{SCHEME}://"))
    if not folder.is_absolute() or folder == Path(folder.anchor):
        raise ValueError(f"broker URL {broker_url!r}: expected {SCHEME}:///absolute/path/of/a/folder")
    return folder_url(folder)


def _transport_options(visibility_timeout_s: float, *, embedded: bool) -> dict[str, Any]:
    options = {"visibility_timeout": visibility_timeout_s, **FAIL_AT_ONCE}
    if embedded:
        return options
    return {
        **options,
        "socket_timeout": SOCKET_TIMEOUT_S,
        "socket_connect_timeout": SOCKET_TIMEOUT_S,
        "socket_keepalive": True,
    }
