"""The Python client against answers made up here: retries, pages, and errors that carry what the server said."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from armature import Client, ConflictError, NotFoundError, ProblemError, RefusedError, ServerUnreachableError
from armature.errors import ApplicationFileError

NO_PAUSES = (0.0, 0.0, 0.0)
ACCEPTED = httpx.Response(202, json={"id": "abc", "state": "queued", "url": "/v1/applications/abc"})
BUSY = httpx.Response(503, json={"title": "Service Unavailable", "status": 503, "detail": "try again"})


class Script:
    """A server that answers what a list says, and remembers what it was asked."""

    def __init__(self, *answers: httpx.Response | Exception) -> None:
        self.answers = iter(answers)
        self.requests: list[httpx.Request] = []

    def __call__(self, request: httpx.Request) -> httpx.Response:
        self.requests.append(request)
        answer = next(self.answers)
        if isinstance(answer, Exception):
            raise answer
        return answer


@pytest.fixture
def client_of() -> Iterator[Callable[..., Client]]:
    """Makes clients of a script, and closes them."""
    made: list[Client] = []

    def make(script: Callable[[httpx.Request], httpx.Response]) -> Client:
        made.append(Client("http://server/", retry_waits_s=NO_PAUSES, transport=httpx.MockTransport(script)))
        return made[-1]

    yield make
    for client in made:
        client.close()


def test_a_submission_is_repeated_with_the_same_key(client_of: Callable[..., Client]) -> None:
    script = Script(httpx.ConnectError("refused"), BUSY, httpx.ReadTimeout("lost"), ACCEPTED)
    assert client_of(script).submit({"name": "a"}).id == "abc"
    keys = {request.headers["idempotency-key"] for request in script.requests}
    assert len(script.requests) == 4
    assert len(keys) == 1


def test_a_repeated_delete_that_finds_nothing_has_done_its_work(client_of: Callable[..., Client]) -> None:
    """Its first answer was lost on the way; a first one that finds nothing is still an error."""
    gone = httpx.Response(404, json={"detail": "there is no application abc"})
    client_of(Script(httpx.ReadTimeout("lost"), gone)).application("abc").delete()
    with pytest.raises(NotFoundError):
        client_of(Script(gone)).application("abc").delete()
    with pytest.raises(NotFoundError):
        client_of(Script(httpx.ReadTimeout("lost"), gone)).application("abc").cancel()


def test_two_submissions_have_two_keys(client_of: Callable[..., Client]) -> None:
    script = Script(ACCEPTED, ACCEPTED)
    client = client_of(script)
    client.submit({"name": "a"})
    client.submit({"name": "a"})
    assert script.requests[0].headers["idempotency-key"] != script.requests[1].headers["idempotency-key"]


def test_a_server_that_stays_away(client_of: Callable[..., Client]) -> None:
    script = Script(*[httpx.ConnectError("refused")] * 4)
    with pytest.raises(ServerUnreachableError, match="http://server: refused"):
        client_of(script).application("abc").status()
    assert len(script.requests) == 4


def test_a_server_that_stays_busy(client_of: Callable[..., Client]) -> None:
    with pytest.raises(ProblemError, match="try again") as caught:
        client_of(Script(*[BUSY] * 4)).application("abc").status()
    assert caught.value.status == 503


def test_a_refusal_names_field_value_and_limit(client_of: Callable[..., Client]) -> None:
    error = {"field": "tasks[0].payload_kg", "value": -1, "limit": "at least 0", "message": "tasks[0].payload_kg ..."}
    script = Script(httpx.Response(422, json={"status": 422, "detail": "refused", "errors": [error]}))
    with pytest.raises(RefusedError) as caught:
        client_of(script).submit({"name": "a"})
    (problem,) = caught.value.errors
    assert (problem.field, problem.value, problem.limit) == ("tasks[0].payload_kg", -1, "at least 0")
    assert len(script.requests) == 1  # asking again would not help


@pytest.mark.parametrize(("status", "kind"), [(404, NotFoundError), (409, ConflictError), (413, RefusedError)])
def test_problems_are_told_apart(client_of: Callable[..., Client], status: int, kind: type[ProblemError]) -> None:
    with pytest.raises(kind, match="because"):
        client_of(Script(httpx.Response(status, json={"detail": "because"}))).submit({"name": "a"})


def test_an_answer_that_is_no_problem_document(client_of: Callable[..., Client]) -> None:
    """Such as a proxy's page."""
    with pytest.raises(ProblemError, match="HTTP 502 Bad Gateway: <html>"):
        client_of(Script(httpx.Response(502, text="<html>"))).application("abc").status()


def test_values_that_json_does_not_know_reach_the_server(client_of: Callable[..., Client]) -> None:
    """The server says which field they are in; the client could only say that there are some."""
    script = Script(ACCEPTED)
    client_of(script).submit({"name": "a", "payload_kg": float("nan")})
    assert json.loads(script.requests[0].content)["payload_kg"] != 0
    assert b"NaN" in script.requests[0].content


def task(index: int) -> dict[str, Any]:
    """A task's answer, as short as the contract lets it be."""
    return {"index": index, "name": f"task {index}", "payload_kg": 0, "weight": 1, "state": "queued", "methods": {}}


def test_tasks_come_from_all_pages(client_of: Callable[..., Client]) -> None:
    def serve(request: httpx.Request) -> httpx.Response:
        start, limit = int(request.url.params["cursor"]), int(request.url.params["limit"])
        stop = min(start + limit, 450)
        items = [task(k) for k in range(start, stop)]
        return httpx.Response(200, json={"items": items, "next_cursor": str(stop) if stop < 450 else None})

    assert [found.index for found in client_of(serve).application("abc").tasks()] == list(range(450))


def test_sweeps_come_from_all_pages(client_of: Callable[..., Client]) -> None:
    item = {"name": "s", "state": "queued", "created_at": "", "tags": [], "axes": ["robot"], "counts": {"queued": 2}}
    first, second = ({"items": [item | {"id": name}]} for name in ("b", "a"))
    script = Script(
        httpx.Response(200, json=first | {"next_cursor": "b"}), httpx.Response(200, json=second | {"next_cursor": None})
    )
    assert [found.id for found in client_of(script).sweeps()] == ["b", "a"]
    assert [request.url.params.get("cursor") for request in script.requests] == [None, "b"]


def test_a_sweep_is_waited_for(client_of: Callable[..., Client]) -> None:
    def answer(state: str) -> httpx.Response:
        about = {"id": "s", "name": "s", "created_at": "", "tags": [], "axes": {}, "dimensions": [], "points": []}
        return httpx.Response(200, json=about | {"state": state, "counts": {state: 1}})

    script = Script(answer("queued"), answer("running"), answer("succeeded"))
    seen: list[str] = []
    found = client_of(script).sweep("s").wait(lambda status: seen.append(status.state), poll_s=0.0)
    assert (found.state, seen) == ("succeeded", ["queued", "running", "succeeded"])
    with pytest.raises(TimeoutError, match="sweep s is running"):
        client_of(Script(answer("running"))).sweep("s").wait(timeout_s=-1.0)


def test_ids_are_escaped(client_of: Callable[..., Client]) -> None:
    script = Script(httpx.Response(404, json={"detail": "there is none"}))
    with pytest.raises(NotFoundError):
        client_of(script).application("../robots").status()
    assert script.requests[0].url.raw_path == b"/v1/applications/..%2Frobots"


def test_a_file_is_read_before_anything_is_sent(client_of: Callable[..., Client], tmp_path: Path) -> None:
    script = Script()
    with pytest.raises(ApplicationFileError, match="there is no file"):
        client_of(script).submit(tmp_path / "none.yaml")
    assert script.requests == []


def test_json_is_yaml(client_of: Callable[..., Client], tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    file.write_text('{"name": "a", "tasks": [{"start_rad": [1e-3], "end_rad": [0]}]}', encoding="utf-8")
    script = Script(ACCEPTED)
    client_of(script).submit(str(file))
    assert json.loads(script.requests[0].content)["tasks"][0]["start_rad"] == [1e-3]
