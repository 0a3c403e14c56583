"""Text that no database keeps is refused at the door: the character U+0000, and halves of surrogate pairs.

JSON can write both (`"\\u0000"`, `"\\ud800"`). Postgres would refuse the one when it is stored in a column, and when it
is read where it was stored in a document; nothing can write the other as UTF-8.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any, Final
from urllib.parse import unquote

from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect, Request
from starlette.types import ASGIApp, Receive, Scope, Send

from api.errors import problem, refusal
from api.yaml_bodies import is_json, replay
from shared.contracts.errors import FieldError, field_path

SUSPECT: Final = re.compile(rb"\\u(0000|[dD][89a-fA-F])")
"""As JSON would write it; found in almost no body, and then it is looked at more closely."""
REFUSED: Final = re.compile("[\0\ud800-\udfff]")
LIMIT: Final = "must be text that can be stored: without U+0000 and halves of surrogate pairs"


class PlainText:
    """ASGI middleware, inside `YamlBodies`."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it with the field."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
        elif "\0" in scope["path"]:
            await problem(404, "there is nothing of this name")(scope, receive, send)
        elif "\0" in (query := unquote(scope["query_string"].decode("latin-1"))):
            await refusal([FieldError("query", query, LIMIT)])(scope, receive, send)
        elif is_json(Headers(scope=scope)):
            await self._look_into_body(scope, receive, send)
        else:
            await self.app(scope, receive, send)

    async def _look_into_body(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            body = await Request(scope, receive).body()
        except ClientDisconnect:
            return
        if not _is_utf8(body):
            await problem(400, "the body is not JSON in UTF-8")(scope, receive, send)
            return
        if SUSPECT.search(body) and (errors := list(_refused(body))):
            await refusal(errors)(scope, receive, send)
            return
        await self.app(scope, replay(body, receive), send)


def _is_utf8(body: bytes) -> bool:
    """JSON has no zero byte; one that does is UTF-16 or UTF-32, in which nothing can be searched."""
    try:
        body.decode()
    except UnicodeDecodeError:
        return False
    return b"\0" not in body


def _refused(body: bytes) -> Iterator[FieldError]:
    try:
        waiting: list[tuple[tuple[str | int, ...], Any]] = [((), json.loads(body))]
    except (ValueError, RecursionError):
        return  # the route says what is wrong with it
    while waiting:
        path, value = waiting.pop()
        if isinstance(value, str) and REFUSED.search(value):
            yield FieldError(field_path(path), value, LIMIT)
        elif isinstance(value, dict):
            yield from (FieldError(field_path((*path, key)), None, LIMIT) for key in value if REFUSED.search(key))
            waiting += [((*path, key), inner) for key, inner in value.items()]
        elif isinstance(value, list):
            waiting += [((*path, k), inner) for k, inner in enumerate(value)]
