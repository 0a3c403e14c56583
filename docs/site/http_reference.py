"""The HTTP interface as a page, from the OpenAPI document of the code at hand."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from typing import Any

from mkdocs.structure.files import File, Files

HEAD = """# HTTP interface

All bodies are JSON (YAML is taken too: `content-type: application/yaml`). Errors are problem documents that name field,
value and limit. The same, for programs: `/v1/openapi.json`.

The examples need a server (`armature up`) and an application on it:

```sh
curl -s http://127.0.0.1:8000/v1/applications -H 'content-type: application/json' -d '{EXAMPLE}' | tee accepted.json
id=$(python3 -c 'import json; print(json.load(open("accepted.json"))["id"])')
until curl -s http://127.0.0.1:8000/v1/applications/$id | grep -q '"state":"succeeded"'; do sleep 0.2; done
```
"""

EXAMPLE = {
    "name": "one move",
    "robot": "ur5",
    "tasks": [{"name": "lift", "start_rad": [0.2] * 6, "end_rad": [0.0] * 6, "payload_kg": 1}],
    "transcription": {"preset": "paper"},
}
"""One task in the paper's transcription: seconds."""
STREAMS = ("/events",)
"""These answer for as long as one listens."""


def on_files(files: Files, config: Any) -> Files:
    """Add the page."""
    files.append(File.generated(config, "http.md", content="\n".join(page(openapi()))))
    return files


def openapi() -> dict[str, Any]:
    """The document that the server gives."""
    from api.app import create_app
    from shared.settings import Settings

    with tempfile.TemporaryDirectory() as home:
        document: dict[str, Any] = create_app(Settings(home=home)).openapi()
    return document


def page(document: dict[str, Any]) -> Iterator[str]:
    """Lines of Markdown: operations by path, then the schemas."""
    yield HEAD.replace("{EXAMPLE}", json.dumps(EXAMPLE))
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            yield from _operation(path, method.upper(), operation)
    yield "\n## Schemas\n"
    for name, schema in sorted(document["components"]["schemas"].items()):
        yield from _schema(name, schema)


def _operation(path: str, method: str, operation: dict[str, Any]) -> Iterator[str]:
    yield f"\n## {method} {path}\n"
    yield operation.get("description", operation.get("summary", "")) + "\n"
    if parameters := operation.get("parameters"):
        yield "| parameter | in | type | |\n|---|---|---|---|"
        for p in parameters:
            needed = " (needed)" if p.get("required") else ""
            yield f"| `{p['name']}`{needed} | {p['in']} | {_type(p['schema'])} | {_cell(p)} |"
        yield ""
    body = operation.get("requestBody", {}).get("content", {}).get("application/json", {}).get("schema")
    if body:
        yield f"Body: {_type(body)}\n"
    for status, response in operation["responses"].items():
        schema = response.get("content", {}).get("application/json", {}).get("schema")
        yield f"- {status}: {response['description']}{', ' + _type(schema) if schema else ''}"
    if (
        method == "GET"
        and not path.endswith(STREAMS)
        and "{" not in path.replace("{application_id}", "").replace("{index}", "")
    ):
        address = path.replace("{application_id}", "$id").replace("{index}", "0")
        yield f'\n```sh\ncurl -sf "http://127.0.0.1:8000{address}"\n```'


def _schema(name: str, schema: dict[str, Any]) -> Iterator[str]:
    yield f"\n### {name}\n"
    yield schema.get("description", "") + "\n"
    if properties := schema.get("properties"):
        yield "| field | type | default | |\n|---|---|---|---|"
        for field, value in properties.items():
            default = "needed" if field in schema.get("required", []) else _code(value.get("default"))
            yield f"| `{field}` | {_type(value)} | {default} | {_cell(value)} |"


def _type(schema: dict[str, Any]) -> str:
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    if options := schema.get("anyOf") or schema.get("oneOf"):
        return " or ".join(dict.fromkeys(_type(option) for option in options))
    if "enum" in schema or "const" in schema:
        return ", ".join(f"`{value}`" for value in schema.get("enum", [schema.get("const")]))
    if schema.get("type") == "array":
        return f"list of {_type(schema.get('items', {}))}"
    return str(schema.get("type", "any"))


def _cell(schema: dict[str, Any]) -> str:
    limits = {
        "minimum": "at least", "exclusiveMinimum": "above", "maximum": "at most", "exclusiveMaximum": "below",
        "minLength": "characters from", "maxLength": "characters up to", "minItems": "items from",
        "maxItems": "items up to",
    }  # fmt: skip
    inner = [schema, schema.get("schema", {}), *schema.get("anyOf", [])]
    found = [f"{words} {part[key]:g}" for part in inner for key, words in limits.items() if key in part]
    return "; ".join(filter(None, [schema.get("description", ""), *found])).replace("|", "\\|").replace("\n", " ")


def _code(value: Any) -> str:
    return "" if value is None else f"`{json.dumps(value)}`".replace("|", "\\|")
