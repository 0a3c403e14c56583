"""Every question to a server as a value: what is sent, and how the answer is read. Shared by both clients."""

from __future__ import annotations

import json
import uuid
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar
from urllib.parse import quote

import httpx
from pydantic import BaseModel, ValidationError

from armature.application_file import read_application, read_robot, read_sweep
from armature.errors import UnexpectedAnswerError
from shared.contracts.comparisons import ComparisonAnswer, DesignAnswer, DesignsAnswer
from shared.contracts.motions import SolverLog, TaskList, TaskResult, Trajectory
from shared.contracts.states import Accepted, ApplicationList, ApplicationStatus
from shared.contracts.sweeps import AcceptedSweep, SweepList, SweepStatus

DEFAULT_URL = "http://127.0.0.1:8000"
TASKS_A_PAGE = 200
REPORT_TIMEOUT_S = 300.0
"""Reports are drawn one at a time."""

Answer_co = TypeVar("Answer_co", covariant=True)
Model = TypeVar("Model", bound=BaseModel)


class Buildable(Protocol):
    """Something that knows its content, such as an `ApplicationBuilder`."""

    def to_dict(self) -> dict[str, Any]:
        """As it would stand in a file."""


Content = str | Path | Mapping[str, Any] | Buildable
"""Path of a YAML or JSON file, its content, or a builder."""


@dataclass(frozen=True)
class Call(Generic[Answer_co]):
    """One question.

    Attributes
    ----------
    read
        The answer in an HTTP answer that is a success.
    timeout_s
        Where it may take longer than the client's own [s].
    """

    method: str
    path: str
    read: Callable[[httpx.Response], Answer_co]
    query: Mapping[str, Any] = field(default_factory=dict)
    headers: Mapping[str, str] = field(default_factory=dict)
    body: str | None = None
    timeout_s: float | None = None

    def options(self) -> dict[str, Any]:
        """Arguments of httpx's `request`."""
        options: dict[str, Any] = {
            "method": self.method,
            "url": self.path,
            "params": {name: value for name, value in self.query.items() if value is not None},
            "headers": dict(self.headers),
        }
        if self.body is not None:
            options["content"] = self.body
        if self.timeout_s is not None:
            options["timeout"] = self.timeout_s
        return options


def submit(application: Content, idempotency_key: str | None) -> Call[str]:
    """Submit an application; the answer is its id."""
    content = _content(application, read_application)
    return _submission("/v1/applications", content, idempotency_key, lambda answer: _model(Accepted)(answer).id)


def submit_sweep(sweep: Content, idempotency_key: str | None) -> Call[str]:
    """Submit a sweep; the answer is its id."""
    content = _content(sweep, read_sweep)
    return _submission("/v1/sweeps", content, idempotency_key, lambda answer: _model(AcceptedSweep)(answer).id)


def applications(cursor: str | None, state: str | None, tag: str | None) -> Call[ApplicationList]:
    """One page."""
    return _get("/v1/applications", _model(ApplicationList), {"cursor": cursor, "state": state, "tag": tag})


def status(application: str) -> Call[ApplicationStatus]:
    """State and progress."""
    return _get(_application(application), _model(ApplicationStatus))


def tasks(application: str, cursor: str | None) -> Call[TaskList]:
    """One page."""
    page = {"cursor": cursor or "0", "limit": TASKS_A_PAGE}
    return _get(_application(application, "/tasks"), _model(TaskList), page)


def task(application: str, index: int) -> Call[TaskResult]:
    """One task."""
    return _get(_application(application, f"/tasks/{index}"), _model(TaskResult))


def design(application: str, method: str | None) -> Call[DesignAnswer]:
    """The design for all tasks."""
    return _get(_application(application, "/design"), _model(DesignAnswer), {"method": method})


def designs(application: str) -> Call[DesignsAnswer]:
    """Every design."""
    return _get(_application(application, "/designs"), _model(DesignsAnswer))


def comparison(application: str) -> Call[ComparisonAnswer]:
    """Methods side by side."""
    return _get(_application(application, "/comparison"), _model(ComparisonAnswer))


def trajectory(application: str, index: int, method: str | None) -> Call[Trajectory]:
    """One motion."""
    return _get(_application(application, f"/tasks/{index}/trajectory"), _model(Trajectory), {"method": method})


def log(application: str, index: int, method: str | None) -> Call[SolverLog]:
    """How one solve went."""
    return _get(_application(application, f"/tasks/{index}/log"), _model(SolverLog), {"method": method})


def inputs(application: str) -> Call[dict[str, Any]]:
    """What the results depend on."""
    return _get(_application(application, "/inputs"), _json)


def report(application: str) -> Call[str]:
    """The report's HTML."""
    return Call("GET", _application(application, "/report"), _text, timeout_s=REPORT_TIMEOUT_S)


def cancel(application: str) -> Call[ApplicationStatus]:
    """Ask for an end."""
    return Call("POST", _application(application, "/cancel"), _model(ApplicationStatus))


def stop_search(application: str) -> Call[ApplicationStatus]:
    """Be content with the best shared design found so far."""
    return Call("POST", _application(application, "/stop_search"), _model(ApplicationStatus))


def retry(application: str) -> Call[ApplicationStatus]:
    """Do again what failed."""
    return Call("POST", _application(application, "/retry"), _model(ApplicationStatus))


def delete(application: str) -> Call[None]:
    """Delete an application."""
    return Call("DELETE", _application(application), _nothing)


def robots() -> Call[list[dict[str, str]]]:
    """Presets and uploads."""
    return _get("/v1/robots", lambda answer: list(_json(answer)["items"]))


def robot(robot_id: str) -> Call[dict[str, Any]]:
    """One robot."""
    return _get(f"/v1/robots/{_quoted(robot_id)}", _json)


def upload_robot(content: str | Path | Mapping[str, Any]) -> Call[str]:
    """Keep a robot; the answer is its id."""
    body = json.dumps(dict(content) if isinstance(content, Mapping) else read_robot(content))
    headers = {"Content-Type": "application/json"}
    return Call("POST", "/v1/robots", lambda answer: str(_json(answer)["id"]), headers=headers, body=body)


def delete_robot(robot_id: str) -> Call[None]:
    """Forget an upload."""
    return Call("DELETE", f"/v1/robots/{_quoted(robot_id)}", _nothing)


def sweeps(cursor: str | None) -> Call[SweepList]:
    """One page."""
    return _get("/v1/sweeps", _model(SweepList), {"cursor": cursor})


def sweep_status(sweep: str) -> Call[SweepStatus]:
    """A sweep's state and table."""
    return _get(f"/v1/sweeps/{_quoted(sweep)}", _model(SweepStatus))


def sweep_csv(sweep: str) -> Call[str]:
    """A sweep's table as CSV."""
    return Call("GET", f"/v1/sweeps/{_quoted(sweep)}", _text, headers={"Accept": "text/csv"})


def cancel_sweep(sweep: str) -> Call[SweepStatus]:
    """Ask all of its applications to end."""
    return Call("POST", f"/v1/sweeps/{_quoted(sweep)}/cancel", _model(SweepStatus))


def delete_sweep(sweep: str) -> Call[None]:
    """Delete a sweep with its applications."""
    return Call("DELETE", f"/v1/sweeps/{_quoted(sweep)}", _nothing)


def new_idempotency_key() -> str:
    """A key that no other submission has."""
    return uuid.uuid4().hex


def _get(
    path: str, read: Callable[[httpx.Response], Answer_co], query: Mapping[str, Any] | None = None
) -> Call[Answer_co]:
    return Call("GET", path, read, query or {})


def _submission(
    path: str, content: Mapping[str, Any], idempotency_key: str | None, read: Callable[[httpx.Response], str]
) -> Call[str]:
    """A POST that can be repeated: a server does once what comes with one key."""
    headers = {"Idempotency-Key": idempotency_key or new_idempotency_key(), "Content-Type": "application/json"}
    # Values that JSON does not know (NaN, dates) travel as they are: the server names the field they are in.
    return Call("POST", path, read, headers=headers, body=json.dumps(content, allow_nan=True, default=str))


def _content(given: Content, read: Callable[[str | Path], dict[str, Any]]) -> dict[str, Any]:
    if isinstance(given, str | Path):
        return read(given)
    return dict(given) if isinstance(given, Mapping) else given.to_dict()


def _application(application: str, rest: str = "") -> str:
    return f"/v1/applications/{_quoted(application)}{rest}"


def _quoted(name: str) -> str:
    return quote(name, safe="")


def _model(kind: type[Model]) -> Callable[[httpx.Response], Model]:
    def read(answer: httpx.Response) -> Model:
        try:
            return kind.model_validate_json(answer.content)
        except ValidationError as error:
            raise UnexpectedAnswerError(str(answer.url), kind.__name__) from error

    return read


def _json(answer: httpx.Response) -> dict[str, Any]:
    try:
        found: dict[str, Any] = answer.json()
    except ValueError as error:
        raise UnexpectedAnswerError(str(answer.url), "JSON") from error
    return found


def _text(answer: httpx.Response) -> str:
    return answer.content.decode()


def _nothing(_: httpx.Response) -> None:
    return None
