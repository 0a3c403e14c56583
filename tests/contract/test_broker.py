"""What every broker promises: the embedded one and Redis pass the same tests."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from shared.dispatch.broker import broker_reachable, queue_size, send
from tests.contract.brokers import Broker, embedded_broker, job_id, needs_ownership, redis_broker
from tests.contract.noop_worker import DIE, NAP, NOTE
from tests.servers import Server, descendants, redis_server

REPOSITORY = Path(__file__).parents[2]
SPAWN = multiprocessing.get_context("spawn")


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with redis_server() as server:
        yield server


@pytest.fixture(params=["embedded", "redis"])
def broker(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Broker]:
    if request.param == "embedded":
        with embedded_broker(tmp_path) as broker:
            yield broker
    else:
        with redis_broker(request.getfixturevalue("server")) as broker:
            yield broker


# ---------------------------------------------------------------------------------------------------- one message


def test_a_message_carries_the_id_of_a_job_and_nothing_else(broker: Broker) -> None:
    app = broker.app()
    with broker.reader() as reader:
        send(app, "some.task", "job-1")
        message = reader.receive()
        message.ack()
        assert message.headers["task"] == "some.task"
        args, kwargs, _ = message.payload
        assert (args, kwargs) == (["job-1"], {})


def test_messages_come_in_the_order_of_sending(broker: Broker) -> None:
    sent = [str(number) for number in range(600)]  # more than one listing of the embedded broker
    app = broker.app()
    with broker.reader() as reader:
        for number in sent:
            send(app, "some.task", number)
        assert reader.ids(len(sent)) == sent


def test_waiting_messages_are_counted(broker: Broker) -> None:
    app = broker.app()
    with broker.reader() as reader:
        assert queue_size(app) == 0
        for number in range(3):
            send(app, "some.task", str(number))
        assert queue_size(app) == 3
        reader.ids(3)
        assert queue_size(app) == 0


def test_an_acknowledged_message_never_returns(broker: Broker) -> None:
    app = broker.app()
    with broker.reader() as reader:
        send(app, "some.task", "job-1")
        reader.receive().ack()
    with broker.reader(visibility_timeout_s=0.1) as reader:
        assert reader.is_empty()


def test_a_message_waits_while_there_is_no_consumer(broker: Broker) -> None:
    app = broker.app()
    send(app, "some.task", "job-1")
    with broker.reader() as reader:
        assert reader.ids(1) == ["job-1"]


# ------------------------------------------------------------------------------------------------------ redelivery


def test_a_requeued_message_comes_again(broker: Broker) -> None:
    app = broker.app()
    with broker.reader() as reader:
        send(app, "some.task", "job-1")
        reader.receive().reject(requeue=True)
        assert reader.ids(1) == ["job-1"]
        assert reader.is_empty()


def test_a_rejected_message_is_gone(broker: Broker) -> None:
    app = broker.app()
    with broker.reader() as reader:
        send(app, "some.task", "job-1")
        reader.receive().reject(requeue=False)
        assert reader.is_empty()


def test_a_consumer_that_leaves_gives_its_messages_back(broker: Broker) -> None:
    app = broker.app()
    for number in range(3):
        send(app, "some.task", str(number))
    with broker.reader(prefetch=2) as reader:
        reader.receive()
        reader.receive()
    with broker.reader() as reader:
        assert sorted(reader.ids(3)) == ["0", "1", "2"]
        assert reader.is_empty()


def test_the_number_of_unacknowledged_messages_is_limited(broker: Broker) -> None:
    app = broker.app()
    with broker.reader(prefetch=2) as reader:
        for number in range(3):
            send(app, "some.task", str(number))
        first, second = reader.receive(), reader.receive()
        assert reader.is_empty()
        first.ack()
        assert job_id(reader.receive()) == "2"
        second.ack()


def test_a_killed_consumer_blocks_nobody_and_its_message_returns(broker: Broker) -> None:
    app = broker.app()
    for number in range(3):
        send(app, "some.task", str(number))
    ready, holds = SPAWN.Pipe(duplex=False)
    holder = SPAWN.Process(target=_hold_one_message, args=(broker.url, broker.queue, holds))
    holder.start()
    held = ready.recv()
    holder.kill()
    holder.join()
    assert held == "0"
    with broker.reader() as reader:
        assert reader.ids(2) == ["1", "2"]
        assert reader.is_empty()
    with broker.reader(visibility_timeout_s=1) as reader:
        deadline = time.monotonic() + 60  # Redis looks for them in every tenth of its idle rounds
        while reader.is_empty():
            assert time.monotonic() < deadline
        assert reader.ids(1) == ["0"]


def _hold_one_message(url: str, queue: str, holds) -> None:  # type: ignore[no-untyped-def]
    with Broker("", url, queue).reader() as reader:
        holds.send(job_id(reader.receive()))
        time.sleep(600)


# -------------------------------------------------------------------------------------------------- many processes


@pytest.mark.parametrize("broker", ["embedded", "redis"], indirect=True)
def test_many_producers_and_consumers_lose_and_double_nothing(broker: Broker) -> None:
    producers, each = 4, 1250 if broker.kind == "embedded" else 250
    found = SPAWN.Queue()
    consumers = [SPAWN.Process(target=_consume, args=(broker.url, broker.queue, found)) for _ in range(2)]
    senders = [SPAWN.Process(target=_produce, args=(broker.url, broker.queue, n, each)) for n in range(producers)]
    for process in consumers + senders:
        process.start()
    for process in senders:
        process.join()
        assert process.exitcode == 0
    app = broker.app()
    for _ in consumers:
        send(app, "some.task", "end")
    shares = [found.get(timeout=120) for _ in consumers]
    for process in consumers:
        process.join()
    counts = Counter(identifier for share in shares for identifier in share)
    expected = {f"{producer}-{number}" for producer in range(producers) for number in range(each)}
    assert set(counts) == expected
    assert set(counts.values()) == {1}
    app = broker.app()
    assert queue_size(app) == 0


def _produce(url: str, queue: str, producer: int, count: int) -> None:
    app = Broker("", url, queue).app()
    for number in range(count):
        send(app, "some.task", f"{producer}-{number}")


def _consume(url: str, queue: str, found) -> None:  # type: ignore[no-untyped-def]
    share: list[str] = []
    with Broker("", url, queue).reader() as reader:
        while (identifier := reader.ids(1)[0]) != "end":
            share.append(identifier)
    found.put(share)


# ------------------------------------------------------------------------------------------------------ real workers


@contextmanager
def running_worker(broker: Broker, folder: Path, start_method: str = "fork") -> Iterator[subprocess.Popen[bytes]]:
    arguments = [broker.url, broker.queue, str(_record(folder)), start_method]
    command = [sys.executable, "-m", "tests.contract.noop_worker", *arguments]
    process = subprocess.Popen(command, cwd=REPOSITORY)
    try:
        yield process
    finally:
        for pid in [process.pid, *descendants(process.pid)] if process.poll() is None else []:
            os.kill(pid, signal.SIGKILL)
        process.wait()


@pytest.fixture
def worker(broker: Broker, tmp_path: Path) -> Iterator[subprocess.Popen[bytes]]:
    with running_worker(broker, tmp_path) as process:
        yield process


@pytest.mark.parametrize("start_method", ["fork", "spawn"])  # macOS does not fork
def test_a_worker_runs_every_task_once_and_ends_on_request(broker: Broker, tmp_path: Path, start_method: str) -> None:
    sent = [f"job-{number}" for number in range(50)]
    app = broker.app()
    for number in sent:
        send(app, NOTE, number)
    with running_worker(broker, tmp_path, start_method) as worker:
        _wait_for(lambda: len(_lines(tmp_path)) >= len(sent))
        family = descendants(worker.pid)
        assert len(family) >= 2
        worker.send_signal(signal.SIGTERM)
        assert worker.wait(20) == 0
        _wait_for(lambda: not any(_is_alive(pid) for pid in family))
    assert sorted(name for name, _ in _lines(tmp_path)) == sorted(sent)
    assert queue_size(app) == 0


def test_a_worker_ends_the_tasks_at_hand_and_leaves_the_others(
    broker: Broker, worker: subprocess.Popen[bytes], tmp_path: Path
) -> None:
    app = broker.app()
    for number in range(4):
        send(app, NAP, str(number))
    _wait_for(lambda: len(_lines(tmp_path)) >= 2)
    worker.send_signal(signal.SIGTERM)
    assert worker.wait(20) == 0
    assert sorted(name for name, _ in _lines(tmp_path)) == ["0-begins", "0-ends", "1-begins", "1-ends"]
    assert queue_size(app) == 2
    with broker.reader() as reader:
        assert sorted(reader.ids(2)) == ["2", "3"]


def test_a_task_that_kills_its_process_runs_once_and_the_worker_goes_on(
    broker: Broker, worker: subprocess.Popen[bytes], tmp_path: Path
) -> None:
    app = broker.app()
    send(app, DIE, "deadly")
    for number in range(10):
        send(app, NOTE, f"job-{number}")
    _wait_for(lambda: len(_lines(tmp_path)) >= 11)
    send(app, NOTE, "last")
    _wait_for(lambda: "last" in dict(_lines(tmp_path)))
    names = Counter(name for name, _ in _lines(tmp_path))
    assert names["deadly"] == 1
    assert len(names) == 12


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends a process when its parent dies")
def test_no_child_outlives_a_killed_worker(broker: Broker, worker: subprocess.Popen[bytes], tmp_path: Path) -> None:
    app = broker.app()
    for number in range(2):
        send(app, NAP, str(number))
    _wait_for(lambda: len(_lines(tmp_path)) == 2)
    family = descendants(worker.pid)
    assert len(family) >= 2
    worker.kill()
    _wait_for(lambda: not any(_is_alive(pid) for pid in family), timeout_s=5)


def test_a_worker_outlives_its_redis_and_finishes_what_it_was_doing(tmp_path: Path) -> None:
    with redis_broker() as broker, running_worker(broker, tmp_path) as worker:
        needs_ownership(broker)
        app = broker.app()
        send(app, NAP, "long")
        _wait_for(lambda: len(_lines(tmp_path)) == 1)
        broker.redis.kill()
        _wait_for(lambda: len(_lines(tmp_path)) == 2)
        broker.redis.start()
        send(app, NOTE, "afterwards")
        _wait_for(lambda: "afterwards" in dict(_lines(tmp_path)))
        worker.send_signal(signal.SIGTERM)
        assert worker.wait(20) == 0


def test_a_worker_outlives_trouble_with_its_folder(tmp_path: Path) -> None:
    with embedded_broker(tmp_path) as broker, running_worker(broker, tmp_path) as worker:
        app = broker.app()
        send(app, NOTE, "before")
        _wait_for(lambda: "before" in dict(_lines(tmp_path)))
        ready = broker.folder / "new"
        ready.rename(broker.folder / "away")
        ready.write_text("a file where a folder should be")  # unlike a missing folder, nobody can mend this
        time.sleep(1)
        ready.unlink()
        (broker.folder / "away").rename(ready)
        send(app, NOTE, "afterwards")
        _wait_for(lambda: "afterwards" in dict(_lines(tmp_path)))
        worker.send_signal(signal.SIGTERM)
        assert worker.wait(20) == 0


def _record(folder: Path) -> Path:
    return folder / "record"


def _lines(folder: Path) -> list[tuple[str, str]]:
    if not _record(folder).exists():
        return []
    return [(name, pid) for name, pid in (line.split() for line in _record(folder).read_text().splitlines())]


def _wait_for(happened: Callable[[], bool], timeout_s: float = 30.0) -> None:
    deadline = time.monotonic() + timeout_s
    while not happened():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.02)


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


# --------------------------------------------------------------------------------------------------- is it there?


def test_a_broker_that_is_there_can_be_reached(broker: Broker) -> None:
    app = broker.app()
    assert broker_reachable(app)


def test_a_folder_that_cannot_be_made_is_no_broker(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    app = Broker("embedded", f"embedded://{tmp_path / 'file' / 'folder'}", "queue").app()
    assert not broker_reachable(app)


def test_a_redis_that_is_frozen_or_gone_cannot_be_reached_and_answers_in_time() -> None:
    with redis_broker() as broker:
        app = broker.app()
        needs_ownership(broker)
        assert broker_reachable(app)
        broker.redis.freeze()
        begin = time.monotonic()
        assert not broker_reachable(app, timeout_s=0.5)
        assert time.monotonic() - begin < 3
        broker.redis.thaw()
        assert broker_reachable(app)
        broker.redis.kill()
        assert not broker_reachable(app)
        broker.redis.start()
        assert broker_reachable(app)
        send(app, "some.task", "after the restart")
        assert queue_size(app) == 1
