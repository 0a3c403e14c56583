"""Bodies that nobody meant, YAML and JSON, to everything that takes one: refused with 4xx, and nothing stored."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest
import yaml
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sqlalchemy import Engine, func, select

from api.app import create_app
from shared.db.engine import make_engine, reading
from shared.db.migrate import upgrade
from shared.db.tables import Application, Sweep, UploadedRobot
from shared.settings import Settings
from tests.servers import Server, postgres_database
from tests.service.requests import body

PATHS = ("/v1/applications", "/v1/robots", "/v1/sweeps", "/v1/session")
JSON, YAML = {"content-type": "application/json"}, {"content-type": "application/yaml"}
REFUSED = frozenset({400, 401, 413, 422})
FEW = settings(
    max_examples=60,
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)

ROBOT = {"name": "r", "urdf": "<robot name='r'/>", "gear_ratio": 100}
SWEEP = {"name": "s", "application": body(), "axes": {"objective.alpha": [0.5]}}
MEANT = {"/v1/applications": body(), "/v1/robots": ROBOT, "/v1/sweeps": SWEEP, "/v1/session": {"key": "k"}}

SCALARS = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(st.characters(), max_size=8)
    | st.sampled_from(["\0", "\ud800", "1e400", "../../etc/passwd", "2020-99-99", 10**400, -(2**63)])
)
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
)


@pytest.fixture(scope="module")
def engine(postgres: Server) -> Iterator[Engine]:
    """Postgres: it is the stricter of the two about what can be stored."""
    with postgres_database(postgres) as url:
        upgrade(url)
        engine = make_engine(url)
        yield engine
        engine.dispose()


@pytest.fixture(scope="module")
def client(engine: Engine, tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """Exceptions come through, so that a 500 shows its cause."""
    url = engine.url.render_as_string(hide_password=False)
    with TestClient(create_app(Settings(home=tmp_path_factory.mktemp("home"), database_url=url))) as client:
        yield client


def stored(engine: Engine) -> list[int | None]:
    """How much there is of everything."""
    with reading(engine) as session:
        return [session.scalar(select(func.count()).select_from(t)) for t in (Application, Sweep, UploadedRobot)]


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Ways to everything inside a value."""
    yield path
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield from places(inner, (*path, key))


def replaced(value: Any, path: tuple[Any, ...], new: Any) -> Any:
    """A copy of `value` with something else in one place."""
    if not path:
        return new
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[path[0]] = replaced(value[path[0]], path[1:], new)
    return copy


@pytest.mark.parametrize("path", PATHS)
@FEW
@given(content=st.binary(max_size=60), headers=st.sampled_from([JSON, YAML]))
def test_bytes(client: TestClient, engine: Engine, path: str, content: bytes, headers: dict[str, str]) -> None:
    before = stored(engine)
    answer = client.post(path, content=b"-" + content, headers=headers)
    assert answer.status_code in REFUSED, answer.text
    assert stored(engine) == before


@pytest.mark.parametrize("path", PATHS)
@FEW
@given(data=st.data())
def test_one_thing_wrong(client: TestClient, path: str, data: st.DataObject) -> None:
    """A body as it should be, with anything at all in one place, which may by chance be right."""
    place = data.draw(st.sampled_from(list(places(MEANT[path]))))
    content = replaced(MEANT[path], place, data.draw(VALUES))
    answer = client.post(path, content=json.dumps(content), headers=JSON)
    assert answer.status_code in REFUSED | {201, 202}, answer.text
    if answer.status_code == 422:
        assert all(error["field"] and error["limit"] for error in answer.json()["errors"])


TAGS = ("!!timestamp", "!!bool", "!!int", "!!float", "!!binary", "!!set", "!!omap", "!!python/object:os.system", "!x")
LINES = st.builds("{}: {} {}".format, st.sampled_from(["name", "tasks", "? [a]", "<<", "*a", "&a b"]),
                  st.sampled_from(["", "&a", "*a", "|", *TAGS]), st.text(max_size=10))  # fmt: skip


@pytest.mark.parametrize("path", PATHS)
@FEW
@given(lines=st.lists(LINES, min_size=1, max_size=4))
def test_yaml(client: TestClient, engine: Engine, path: str, lines: list[str]) -> None:
    before = stored(engine)
    text = "\n".join(lines).encode("utf-8", "surrogatepass")
    assert client.post(path, content=text, headers=YAML).status_code in REFUSED
    assert stored(engine) == before


@pytest.mark.parametrize("path", PATHS)
@FEW
@given(value=VALUES)
def test_yaml_of_anything(client: TestClient, path: str, value: Any) -> None:
    text = yaml.safe_dump(value).encode("utf-8", "surrogatepass")
    assert client.post(path, content=text, headers=YAML).status_code in REFUSED


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("text", ["a\0b", "\ud800"])
def test_text_that_no_database_keeps(client: TestClient, engine: Engine, path: str, text: str) -> None:
    before = stored(engine)
    places_of_text = [place for place in places(MEANT[path]) if isinstance(_at(MEANT[path], place), str)]
    for place in places_of_text:
        answer = client.post(path, content=json.dumps(replaced(MEANT[path], place, text)), headers=JSON)
        assert answer.status_code == 422, (place, answer.text)
        assert "U+0000" in answer.json()["errors"][0]["limit"]
    assert client.post(path, content=json.dumps({text: 1}), headers=JSON).status_code == 422
    utf_16 = json.dumps(replaced(MEANT[path], places_of_text[0], text)).encode("utf-16")
    assert client.post(path, content=utf_16, headers=JSON).status_code == 400
    assert stored(engine) == before


def _at(value: Any, path: tuple[Any, ...]) -> Any:
    for part in path:
        value = value[part]
    return value


@pytest.mark.parametrize("path", ["/v1/applications/%00", "/v1/applications/%00/tasks/0", "/v1/robots/%00"])
def test_a_path_that_no_database_keeps(client: TestClient, path: str) -> None:
    assert client.get(path).status_code == 404
    assert client.delete(path).status_code in {404, 405}


@pytest.mark.parametrize("query", ["cursor=%00", "tag=a%00", "name=%00"])
def test_a_query_that_no_database_keeps(client: TestClient, query: str) -> None:
    assert client.get(f"/v1/applications?{query}").status_code == 422


@pytest.mark.parametrize("number", [-1, 3, 2**31, 2**63, 10**30])
def test_numbers_beyond_the_database(client: TestClient, number: int) -> None:
    application = f"/v1/applications/{client.post('/v1/applications', json=body()).json()['id']}"
    for below in ("", "/trajectory", "/log", "/solution"):
        assert client.get(f"{application}/tasks/{number}{below}").status_code == 404
    assert client.get(f"{application}/tasks?cursor={number}").status_code == (422 if number < 0 else 200)
    client.post(f"{application}/cancel")
    if number > 3:
        assert client.get(f"{application}/events?after={number}").status_code == 422
        assert client.get(f"{application}/events", headers={"Last-Event-ID": str(number)}).status_code == 422
