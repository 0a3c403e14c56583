"""A body may be YAML wherever it may be JSON: `content-type: application/yaml`. Routes see JSON, and nothing else."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from typing import Final

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect, Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from api.access import CLOSED
from api.errors import problem
from shared.yaml_document import YamlError, read_yaml

MEDIA_TYPES: Final = frozenset({"application/yaml", "application/x-yaml", "text/yaml", "text/x-yaml"})
JSON: Final = "application/json"
UNSUPPORTED: Final = 415
LONGEST_SHOWN: Final = 100


class YamlBodies:
    """ASGI middleware; inside the limit on a body's size. 415 for a body that is neither JSON nor YAML."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, a YAML body as JSON."""
        if scope["type"] != "http" or not _has_body(headers := Headers(scope=scope)):
            await self.app(scope, receive, send)
            return
        if is_json(headers) or not scope["path"].startswith(CLOSED):
            await self.app(scope, receive, send)
            return
        if (kind := _media_type(headers)) not in MEDIA_TYPES:
            said = f"content-type {kind[:LONGEST_SHOWN]}" if kind else "no content-type"
            refused = problem(UNSUPPORTED, f"a body is {JSON} or application/yaml; this has {said}")
            await refused(scope, receive, send)
            return
        try:
            body = await run_in_threadpool(_as_json, await Request(scope, receive).body())
        except ClientDisconnect:
            return
        except ValueError as error:
            await problem(400, f"the body is not YAML: {error}")(scope, receive, send)
            return
        inner = _json_scope(scope, len(body))
        await self.app(inner, replay(body, receive), send)
        if "route" in inner:
            scope["route"] = inner["route"]  # for those outside who count by route


def is_json(headers: Headers) -> bool:
    """Whether a request says that its body is JSON."""
    return _media_type(headers) == JSON


def _media_type(headers: Headers) -> str:
    return headers.get("content-type", "").partition(";")[0].strip().lower()


def _has_body(headers: Headers) -> bool:
    return headers.get("content-length", "0") != "0" or "transfer-encoding" in headers


def _as_json(body: bytes) -> bytes:
    """Dates and the like become text, which the contract then judges."""
    try:
        return json.dumps(read_yaml(body.decode("utf-8")), default=str).encode()
    except UnicodeDecodeError as error:
        raise YamlError(f"byte {error.start} is not UTF-8") from error
    except TypeError as error:
        raise YamlError(str(error)) from error


def _json_scope(scope: Scope, length: int) -> Scope:
    inner = {**scope, "headers": list(scope["headers"])}
    headers = MutableHeaders(scope=inner)
    headers["content-type"], headers["content-length"] = "application/json", str(length)
    if "transfer-encoding" in headers:
        del headers["transfer-encoding"]
    return inner


def replay(body: bytes, receive: Receive) -> Callable[[], Awaitable[Message]]:
    """The whole body at once; then whatever the server says, such as that the client went away."""
    sent = False

    async def replay() -> Message:
        nonlocal sent
        if sent:
            return await receive()
        sent = True
        return {"type": "http.request", "body": body, "more_body": False}

    return replay
