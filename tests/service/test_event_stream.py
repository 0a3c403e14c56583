"""Server-sent events over a real socket: complete, and resumable at any event."""

from __future__ import annotations

import asyncio
import json
import threading
import time
from collections.abc import Iterator, MutableMapping

import httpx
import pytest
import uvicorn
from fastapi.testclient import TestClient
from sqlalchemy import Engine

from api.app import create_app
from services.jobs.submit import submit
from shared.settings import Settings
from tests.servers import free_port
from tests.service.queue_actions import drain
from tests.service.requests import application

TIMEOUT_S = 20.0


@pytest.fixture
def url(settings: Settings) -> Iterator[str]:
    """The API on a free port."""
    port = free_port()
    server = uvicorn.Server(uvicorn.Config(create_app(settings), port=port, log_config=None))
    thread = threading.Thread(target=server.run)
    thread.start()
    deadline = time.monotonic() + TIMEOUT_S
    while not server.started:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    yield f"http://127.0.0.1:{port}"
    server.should_exit = True
    thread.join()


def follow(url: str, last: int | None = None, most: int | None = None) -> list[tuple[int, str, dict[str, object]]]:
    """(number, kind, content) of events until the stream ends, or `most` have come and the line is cut."""
    events = []
    headers = {} if last is None else {"Last-Event-ID": str(last)}
    with httpx.stream("GET", url, headers=headers, timeout=TIMEOUT_S) as stream:
        assert stream.headers["content-type"].startswith("text/event-stream")
        fields: dict[str, str] = {}
        for line in stream.iter_lines():
            if line and not line.startswith(":"):
                name, _, value = line.partition(": ")
                fields[name] = value
            elif fields:
                events.append((int(fields["id"]), fields["event"], json.loads(fields["data"])))
                fields = {}
                if len(events) == most:
                    break
    return events


def test_a_stream_cut_twenty_times_has_no_gap_and_no_repeat(engine: Engine, settings: Settings, url: str) -> None:
    application_id, _ = submit(engine, settings, application())
    address = f"{url}/v1/applications/{application_id}/events"
    whole: list[tuple[int, str, dict[str, object]]] = []
    reader = threading.Thread(target=lambda: whole.extend(follow(address)))
    reader.start()
    drain(engine)
    reader.join(TIMEOUT_S)
    pieces: list[tuple[int, str, dict[str, object]]] = []
    for _ in range(20):
        pieces += follow(address, last=pieces[-1][0] if pieces else None, most=1)
    pieces += follow(address, last=pieces[-1][0])
    assert pieces == whole
    assert [number for number, _, _ in whole] == list(range(1, len(whole) + 1))
    assert whole[-1][1:] == ("application", {"at": whole[-1][2]["at"], "state": "succeeded", "reason": None})


def test_no_stream_of_an_unknown_application(url: str) -> None:
    answer = httpx.get(f"{url}/v1/applications/nothing/events")
    assert answer.status_code == 404
    assert answer.headers["content-type"] == "application/problem+json"


def test_a_listener_who_leaves_is_no_error(engine: Engine, settings: Settings) -> None:
    """The server says that nobody is there any more (`OSError`, as ASGI has it); the application stays silent."""
    application_id, _ = submit(engine, settings, application())
    drain(engine)
    path = f"/v1/applications/{application_id}/events"
    scope = {
        "type": "http", "asgi": {"version": "3.0", "spec_version": "2.4"}, "http_version": "1.1", "method": "GET",
        "path": path, "raw_path": path.encode(), "query_string": b"", "headers": [], "scheme": "http",
        "root_path": "", "client": ("127.0.0.1", 1), "server": ("127.0.0.1", 2),
    }  # fmt: skip
    app = create_app(settings)
    with TestClient(app):  # which closes its connections
        for heard in range(1, 4):
            bodies = 0

            async def receive() -> dict[str, object]:
                return {"type": "http.request", "body": b"", "more_body": False}

            async def send(message: MutableMapping[str, object], heard: int = heard) -> None:
                nonlocal bodies
                bodies += message["type"] == "http.response.body"
                if bodies >= heard:
                    raise OSError("nobody is there")

            asyncio.run(app(dict(scope), receive, send))
            assert bodies >= heard
