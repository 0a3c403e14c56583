"""Client and AsyncClient are one client: the same methods, the same requests, the same patience, the same errors."""

from __future__ import annotations

import asyncio
import inspect
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime
from typing import Any

import httpx
import pytest
from sqlalchemy import Engine

import armature
from api.app import create_app
from armature import ApplicationBuilder, AsyncClient, Client, NotFoundError, TooManyRequestsError, UnexpectedAnswerError
from armature import async_client as async_module
from armature import client as sync_module
from shared.settings import Settings
from tests.service.requests import body

ACCEPTED = {"id": "abc", "state": "queued", "url": "/v1/applications/abc"}
LOST = httpx.ConnectError("refused")

Ask = Callable[..., Any]
"""Calls a method of a client, by the clients' common words, against a server that a function plays."""


def ask_sync(serve: Callable[[httpx.Request], httpx.Response], method: str, *given: Any, **options: Any) -> Any:
    with Client("http://server", transport=httpx.MockTransport(serve), **options) as client:
        return getattr(client, method)(*given)


def ask_async(serve: Callable[[httpx.Request], httpx.Response], method: str, *given: Any, **options: Any) -> Any:
    async def run() -> Any:
        async with AsyncClient("http://server", transport=httpx.MockTransport(serve), **options) as client:
            return await getattr(client, method)(*given)

    return asyncio.run(run())


@pytest.fixture(params=[ask_sync, ask_async], ids=["sync", "async"])
def ask(request: pytest.FixtureRequest) -> Ask:
    found: Ask = request.param
    return found


@pytest.fixture
def pauses(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """How long the clients slept, without the sleeping."""
    slept: list[float] = []

    async def sleep(seconds: float) -> None:
        slept.append(seconds)

    monkeypatch.setattr(sync_module.time, "sleep", slept.append)
    monkeypatch.setattr(async_module.asyncio, "sleep", sleep)
    return slept


def script(*answers: httpx.Response | Exception | dict[str, Any]) -> Callable[[httpx.Request], httpx.Response]:
    """A server that gives these answers in turn, 202 with a dict; what it was asked is in its `requests`."""
    left = iter(answers)

    def serve(request: httpx.Request) -> httpx.Response:
        serve.requests.append(request)  # type: ignore[attr-defined]
        answer = next(left)
        if isinstance(answer, Exception):
            raise answer
        return httpx.Response(202, json=answer) if isinstance(answer, dict) else answer

    serve.requests = []  # type: ignore[attr-defined]
    return serve


def refused(status: int, retry_after: str | None) -> httpx.Response:
    headers = {} if retry_after is None else {"Retry-After": retry_after}
    return httpx.Response(status, json={"detail": "not now"}, headers=headers)


@asynccontextmanager
async def served(settings: Settings, **options: Any) -> AsyncIterator[AsyncClient]:
    """A client of the real application, without a socket."""
    app = create_app(settings)
    async with app.router.lifespan_context(app):
        transport = httpx.ASGITransport(app)
        async with AsyncClient("http://server", transport=transport, **options) as client:
            yield client


@pytest.mark.parametrize("name", ["Client", "Application", "Sweep", "Results"])
def test_they_have_the_same_methods(name: str) -> None:
    """With the same parameters and defaults."""
    twin = {"Client": "AsyncClient"}.get(name, f"Async{name}")
    one, other = (_methods(getattr(armature, kind)) for kind in (name, twin))
    assert one == other


def _methods(kind: type) -> dict[str, list[tuple[str, Any]]]:
    functions = {name: function for name, function in vars(kind).items() if inspect.isfunction(function)}
    return {
        name: [(p.name, p.default) for p in inspect.signature(function).parameters.values()]
        for name, function in functions.items()
        if not name.startswith("_")
    }


def test_a_full_server_is_asked_again_when_it_says(ask: Ask, pauses: list[float]) -> None:
    """429 and 503 with Retry-After, in seconds; every attempt carries the same key."""
    serve = script(refused(429, "7"), refused(503, "5"), ACCEPTED)
    ask(serve, "submit", {"name": "a"})
    assert pauses == [7.0, 5.0]
    assert len({request.headers["idempotency-key"] for request in serve.requests}) == 1  # type: ignore[attr-defined]


def test_the_time_to_ask_again_may_be_a_date(ask: Ask, pauses: list[float]) -> None:
    date = format_datetime(datetime.now(UTC) + timedelta(seconds=20), usegmt=True)
    ask(script(refused(429, date), ACCEPTED), "submit", {"name": "a"})
    assert pauses == [pytest.approx(20.0, abs=2.0)]


def test_patience_ends(ask: Ask, pauses: list[float]) -> None:
    """What is asked for is waited in all at most; the error says how long the server wanted."""
    with pytest.raises(TooManyRequestsError, match="not now") as caught:
        ask(script(refused(429, "30"), refused(429, "31")), "submit", {"name": "a"}, patience_s=60.0)
    assert (pauses, caught.value.retry_after_s, caught.value.status) == ([30.0], 31.0, 429)
    with pytest.raises(TooManyRequestsError):
        ask(script(refused(429, "1")), "submit", {"name": "a"}, patience_s=0.0)
    with pytest.raises(TooManyRequestsError) as unsaid:
        ask(script(refused(429, "soon")), "submit", {"name": "a"})
    assert unsaid.value.retry_after_s is None


def test_pauses_grow_when_nobody_answers(ask: Ask, pauses: list[float]) -> None:
    ask(script(LOST, LOST, refused(503, None), ACCEPTED), "submit", {"name": "a"})
    assert pauses == [0.1, 0.2, 0.4]
    with pytest.raises(armature.ServerUnreachableError, match="http://server: refused"):
        ask(script(*[LOST] * 6), "submit", {"name": "a"})


def test_a_repeated_delete_that_finds_nothing_has_done_its_work(ask: Ask, pauses: list[float]) -> None:
    gone = httpx.Response(404, json={"detail": "there is no robot abc"})
    ask(script(LOST, gone), "delete_robot", "abc")
    assert len(pauses) == 1
    with pytest.raises(NotFoundError):
        ask(script(gone), "delete_robot", "abc")


@pytest.mark.parametrize("text", ["<html>welcome</html>", '{"something": "else"}'])
def test_something_else_that_answers_is_named(ask: Ask, text: str) -> None:
    """As behind a wrong address or a proxy's login."""
    with pytest.raises(UnexpectedAnswerError, match=r"http://server/v1/applications .* no Armature server"):
        ask(lambda _: httpx.Response(200, text=text), "submit", {"name": "a"})


def test_a_real_server_says_when_to_ask_again(settings: Settings, engine: Engine) -> None:
    """Over the rate: the wait that its answer names, as an error when there is no patience."""

    async def run() -> float | None:
        async with served(settings.model_copy(update={"rate_per_minute": 2}), patience_s=0.0) as client:
            await client.robots()
            await client.robots()
            with pytest.raises(TooManyRequestsError, match="at most 2 a minute") as caught:
                await client.robots()
        return caught.value.retry_after_s

    wait_s = asyncio.run(run())
    assert wait_s is not None
    assert 1 <= wait_s <= 60


def test_waits_end_alike() -> None:
    """A time-out names what was waited for; progress sees every status; both stop at the first final one."""
    about = {
        "id": "s", "name": "s", "created_at": "", "tags": [], "axes": {}, "dimensions": [], "points": [], "counts": {},
    }  # fmt: skip
    answers = [httpx.Response(200, json=about | {"state": state}) for state in ("queued", "running", "succeeded")]
    seen: list[str] = []

    async def run(*answers: httpx.Response, **options: Any) -> str:
        async with AsyncClient(transport=httpx.MockTransport(script(*answers))) as client:
            return (await client.sweep("s").wait(lambda found: seen.append(found.state), poll_s=0.0, **options)).state

    assert asyncio.run(run(*answers)) == "succeeded"
    assert seen == ["queued", "running", "succeeded"]
    with pytest.raises(TimeoutError, match=r"sweep s is queued after -1\.0 s"):
        asyncio.run(run(*answers, timeout_s=-1.0))


def test_waiting_lets_others_run() -> None:
    """While one call pauses, another is asked."""
    asked: list[str] = []

    def serve(request: httpx.Request) -> httpx.Response:
        asked.append(json.loads(request.content)["name"])
        return httpx.Response(202, json=ACCEPTED) if len(asked) > 2 else refused(503, None)

    async def run() -> None:
        async with AsyncClient(transport=httpx.MockTransport(serve), retry_waits_s=(0.01,)) as client:
            await asyncio.gather(client.submit({"name": "a"}), client.submit({"name": "b"}))

    asyncio.run(run())
    assert asked[:2] == ["a", "b"]
    assert len(asked) == 4


def test_a_builder_is_what_a_file_would_say(ask: Ask) -> None:
    """The server understands it as the request that was written by hand."""
    cell = (
        ApplicationBuilder("cell 3", robot="ur5")
        .minimise("weighted", alpha=0.3)
        .task("lift", start_rad=(0.6,) * 6, end_rad=[0] * 6, payload_kg=2, weight=3.0)
        .motor(current_limit_A=4.0)
        .motor(bounds_mm={"L": [20, 80]})
        .transcription(preset="paper")
        .starts(3)
        .compare("empirical", task="lift")
        .tags("cell")
    )
    by_hand = {
        "name": "cell 3",
        "robot": "ur5",
        "objective": {"kind": "weighted", "alpha": 0.3},
        "tasks": [{"name": "lift", "start_rad": [0.6] * 6, "end_rad": [0.0] * 6, "payload_kg": 2, "weight": 3.0}],
        "motor": {"current_limit_A": 4.0, "bounds_mm": {"L": [20, 80]}},
        "transcription": {"preset": "paper"},
        "starts": 3,
        "compare": ["empirical"],
        "empirical_task": "lift",
        "tags": ["cell"],
    }
    serve = script(ACCEPTED)
    ask(serve, "submit", cell)
    assert json.loads(serve.requests[0].content) == by_hand  # type: ignore[attr-defined]


def test_a_step_leaves_the_builder_before_it_alone() -> None:
    one = ApplicationBuilder("a").task("x", start_rad=[0.1], end_rad=[0.0])
    one.task("y", start_rad=[0.1], end_rad=[0.0]).tags("t")
    one.to_dict()["tasks"].clear()
    assert [task["name"] for task in one.to_dict()["tasks"]] == ["x"]
    assert one.grid([0.2], [0.0]).to_dict()["tasks"] == {"grid": {"stroke": [0.2], "payload_kg": [0.0]}}


def test_a_builder_is_accepted_by_a_server(settings: Settings, engine: Engine) -> None:
    async def run() -> str:
        async with served(settings) as client:
            built = ApplicationBuilder("built").grid([0.2, 0.4], [0, 1], duration_s=1.0).minimise("energy").tags("b")
            application = await client.submit(built)
            assert [item.name async for item in client.applications(tag="b")] == ["built"]
            again = await client.submit(body(name="by hand"), idempotency_key="k")
            assert again.id == (await client.submit(body(name="by hand"), idempotency_key="k")).id
            return (await application.status()).objective.kind

    assert asyncio.run(run()) == "energy"
