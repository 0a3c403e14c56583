"""The interface's description: what FastAPI reads from the routes, and the problems that any of them may answer with.

Problems come from one place (`api.errors`, and the middleware), so they are described in one place, from what an
operation is: a new route cannot forget them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from fastapi import FastAPI

from api.access import CLOSED, OPEN
from api.errors import MEDIA_TYPE, Problem
from api.yaml_bodies import MEDIA_TYPES as YAML

PROBLEMS: Final = {
    "400": "the body is neither JSON nor YAML",
    "401": "no valid API key is shown",
    "403": "a browser's session is used from another site",
    "404": "there is nothing of that name, or it belongs to another key",
    "409": "it cannot be done in this state, or the Idempotency-Key was used with another body",
    "413": "the body is too large",
    "415": "the body is of another type than JSON or YAML",
    "422": "refused: `errors` names each field, its value and the limit",
    "429": "too many requests, or too many jobs in the queue",
    "503": "the database cannot be reached",
}
RETRY_AFTER: Final = {"Retry-After": {"description": "seconds", "schema": {"type": "integer"}}}
CONFLICTING: Final = ("/retry", "/stop_search", "/applications", "/sweeps")
"""Ends of paths whose POST may answer 409."""
MADE_BY_FRAMEWORK: Final = ("HTTPValidationError", "ValidationError")


def describe_problems(app: FastAPI) -> None:
    """Let the application's document name them all."""
    of_routes = app.openapi

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = _with_problems(of_routes())
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]


def _with_problems(document: dict[str, Any]) -> dict[str, Any]:
    schemas = document["components"]["schemas"]
    for name in MADE_BY_FRAMEWORK:
        schemas.pop(name, None)
    template = "#/components/schemas/{model}"
    described = Problem.model_json_schema(ref_template=template)
    schemas |= {**described.pop("$defs"), Problem.__name__: described}
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            operation["responses"].pop("422", None)  # the framework's, which never leaves
            operation["responses"] |= {status: _response(status) for status in _statuses(path, method, operation)}
            if (body := operation.get("requestBody")) is not None:
                body["content"] |= dict.fromkeys(sorted(YAML)[:1], body["content"]["application/json"])
    return document


def _statuses(path: str, method: str, operation: dict[str, Any]) -> Iterator[str]:
    if not path.startswith(CLOSED):
        return
    has_body, has_parameters = "requestBody" in operation, "parameters" in operation
    conditions = {
        "400": has_body,
        "401": path not in OPEN or method == "post",
        "403": method != "get",
        "404": "{" in path,
        "409": method == "post" and path.endswith(CONFLICTING),
        "413": has_body,
        "415": has_body,
        "422": has_body or has_parameters,
        "429": True,
        "503": True,
    }
    yield from (status for status, may_be in conditions.items() if may_be)


def _response(status: str) -> dict[str, Any]:
    headers = {"headers": RETRY_AFTER} if status in ("429", "503") else {}
    schema = {"$ref": f"#/components/schemas/{Problem.__name__}"}
    return {"description": PROBLEMS[status], **headers, "content": {MEDIA_TYPE: {"schema": schema}}}
