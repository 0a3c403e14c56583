"""What only the embedded broker has to withstand: files and folders are open to accidents that a server is not."""

from __future__ import annotations

import base64
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from kombu.exceptions import OperationalError

from shared.dispatch.broker import celery_app, queue_size, send
from shared.dispatch.folder_transport import folder_url
from shared.dispatch.message_folder import CLAIMS_PER_LISTING, MessageFolder
from tests.contract.brokers import Broker, embedded_broker

HOUR_NS = 3600 * 10**9


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    with embedded_broker(tmp_path) as broker:
        yield broker


@pytest.fixture
def messages(tmp_path: Path) -> MessageFolder:
    return MessageFolder(tmp_path / "queue")


def claimed(messages: MessageFolder) -> Path:
    path = messages.claim()
    assert path is not None
    return path


# ---------------------------------------------------------------------------------------------- files gone bad


def _message(**changes: object) -> bytes:
    body = base64.b64encode(b'[["job"], {}, {}]').decode()
    properties = {"body_encoding": "base64", "delivery_tag": "tag", "delivery_info": {}}
    content = {"body": body, "headers": {}, "content-type": "application/json", "content-encoding": "utf-8"}
    return json.dumps({**content, "properties": properties, **changes}).encode()


BAD_CONTENTS: dict[str, bytes] = {
    "empty": b"",
    "half": _message()[:40],
    "not text": b"\xff\xfe\x00",
    "not an object": b"[1, 2]",
    "no properties": b"{}",
    "properties of another kind": _message(properties=7),
    "body not base64": _message(body="a"),
    "nested beyond all measure": b"[" * 100_000,
}


@pytest.mark.parametrize("content", BAD_CONTENTS.values(), ids=BAD_CONTENTS.keys())
def test_a_file_that_is_no_message_is_set_aside_and_the_next_one_comes(broker: Broker, content: bytes) -> None:
    app = broker.app()
    with broker.reader() as reader:
        (broker.folder / "new" / "00000000000000000001-bad.msg").write_bytes(content)  # it sorts before any other
        send(app, "some.task", "good")
        assert reader.ids(1) == ["good"]
    assert [path.name for path in (broker.folder / "bad").iterdir()] == ["00000000000000000001-bad.msg"]
    assert not list((broker.folder / "cur").iterdir())


def test_a_folder_in_place_of_a_message_is_set_aside(broker: Broker) -> None:
    app = broker.app()
    with broker.reader() as reader:
        (broker.folder / "new" / "0-folder.msg").mkdir()
        send(app, "some.task", "good")
        assert reader.ids(1) == ["good"]


def test_files_of_other_kinds_are_left_alone(broker: Broker) -> None:
    app = broker.app()
    with broker.reader() as reader:
        stranger = broker.folder / "new" / ".DS_Store"
        stranger.write_text("")
        assert reader.is_empty()
        assert queue_size(app) == 0
        assert stranger.exists()


def test_a_folder_deleted_under_producer_and_consumer_comes_back(broker: Broker) -> None:
    app = broker.app()
    with broker.reader() as reader:
        send(app, "some.task", "before")
        assert reader.ids(1) == ["before"]
        for state in (broker.folder / "new", broker.folder / "cur", broker.folder / "tmp"):
            state.rmdir()
        send(app, "some.task", "after")
        assert reader.ids(1) == ["after"]
        (broker.folder / "new").rmdir()
        assert reader.is_empty()
        send(app, "some.task", "again")
        assert reader.ids(1) == ["again"]


# -------------------------------------------------------------------------------------------------- the folder


def test_one_claim_is_one_message_whoever_has_listed_it(messages: MessageFolder) -> None:
    other = MessageFolder(messages.folder)
    for number in range(4):
        messages.put(str(number).encode())
    first, second = claimed(messages), claimed(other)  # both have listed all four by now
    third, fourth = claimed(messages), claimed(other)
    assert [path.read_bytes() for path in (first, second, third, fourth)] == [b"0", b"1", b"2", b"3"]
    assert messages.claim() is None
    assert other.claim() is None


def test_a_message_put_back_keeps_its_place(messages: MessageFolder) -> None:
    for number in range(3):
        messages.put(str(number).encode())
    messages.put_back(claimed(messages))
    assert claimed(MessageFolder(messages.folder)).read_bytes() == b"0"


def test_a_message_put_back_waits_for_one_listing_at_most(messages: MessageFolder) -> None:
    for number in range(2 * CLAIMS_PER_LISTING):
        messages.put(str(number).encode())
    messages.put_back(claimed(messages))
    contents = [claimed(messages).read_bytes() for _ in range(CLAIMS_PER_LISTING)]
    assert contents[-1] == b"0"


def test_a_claim_expires_and_what_its_old_consumer_does_then_changes_nothing(messages: MessageFolder) -> None:
    messages.put(b"content")
    old = claimed(messages)
    assert messages.put_back_expired(3600) == 0
    time.sleep(0.01)
    assert messages.put_back_expired(0.001) == 1
    messages.acknowledge(old)
    messages.put_back(old)
    messages.refuse(old)
    assert messages.size() == 1
    new = claimed(messages)
    assert new.read_bytes() == b"content"
    messages.acknowledge(old)
    assert new.exists()


def test_what_a_killed_producer_left_is_removed_and_never_delivered(messages: MessageFolder) -> None:
    old = messages.folder / "tmp" / f"{time.time_ns() - 2 * HOUR_NS:020d}-old.msg"
    fresh = messages.folder / "tmp" / f"{time.time_ns():020d}-fresh.msg"
    old.write_bytes(b"half")
    fresh.write_bytes(b"half")
    assert messages.claim() is None
    assert messages.put_back_expired(3600) == 0
    assert not old.exists()
    assert fresh.exists()


def test_purging_deletes_what_is_ready_and_nothing_else(messages: MessageFolder) -> None:
    for number in range(3):
        messages.put(str(number).encode())
    held = claimed(messages)
    assert messages.purge() == 2
    assert messages.size() == 0
    assert held.exists()


def test_a_queue_stays_inside_its_broker_whatever_it_is_called(tmp_path: Path) -> None:
    app = celery_app(f"embedded://{tmp_path / 'broker'}", queue="../../elsewhere")
    send(app, "some.task", "job-1")
    assert queue_size(app) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["broker"]
    assert len(list((tmp_path / "broker").iterdir())) == 1


def test_the_folder_is_made_for_its_owner_only(broker: Broker) -> None:
    send(broker.app(), "some.task", "job-1")
    assert broker.folder.parent.stat().st_mode & 0o077 == 0


# ---------------------------------------------------------------------------------------------- URLs and settings


@pytest.mark.parametrize("url", ["embedded://", "embedded:///", "embedded://relative/folder", "embedded:relative"])
def test_a_url_without_an_absolute_folder_is_refused(url: str) -> None:
    with pytest.raises(ValueError, match="absolute"):
        celery_app(url)


def test_a_folder_s_url_leads_back_to_it(tmp_path: Path) -> None:
    folder = tmp_path / "ä b; c%20#?@:d"
    app = celery_app(f"embedded://{folder}")
    assert app.conf.broker_url == folder_url(folder)
    with app.connection_for_write() as connection:
        connection.ensure_connection()
    assert folder.is_dir()


def test_celery_s_own_environment_variables_send_nothing_elsewhere(
    broker: Broker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CELERY_BROKER_URL", "memory://")
    send(broker.app(), "some.task", "job-1")
    with broker.reader() as reader:
        assert reader.ids(1) == ["job-1"]


def test_importing_the_broker_makes_no_application_and_no_folder(tmp_path: Path) -> None:
    program = (
        "import shared.dispatch.broker, celery._state, kombu.transport;"
        "assert not list(celery._state._apps);"
        "assert 'embedded' not in kombu.transport.TRANSPORT_ALIASES;"
        "app = shared.dispatch.broker.celery_app('embedded:///nowhere/at/all');"
        "assert celery._state._tls.current_app is None and celery._state.default_app is None"
    )
    subprocess.run([sys.executable, "-c", program], check=True, cwd=Path(__file__).parents[2])
    assert not Path("/nowhere").exists()


@pytest.mark.parametrize("act", [queue_size, lambda app: send(app, "some.task", "job-1")], ids=["size", "send"])
def test_a_broker_that_cannot_be_written_to_says_so(tmp_path: Path, act: Callable[..., object]) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OperationalError, match="file"):
        act(celery_app(f"embedded://{tmp_path / 'file' / 'folder'}"))
