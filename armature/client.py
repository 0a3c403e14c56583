"""The Python client: submit applications to a server, wait for them, read their results.

from armature import Client

application = Client("http://127.0.0.1:8000").submit("examples/pick_and_place.yaml")
application.wait()
print(application.design().design_mm)
"""

from __future__ import annotations

import json
import os
import time
import uuid
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self
from urllib.parse import quote

import httpx

from armature.application_file import read_application, read_robot, read_sweep
from armature.errors import ServerUnreachableError, problem_of
from armature.sweep import Sweep
from armature.waiting import until_final
from shared.contracts.results import (
    Accepted,
    ApplicationItem,
    ApplicationList,
    ApplicationStatus,
    ComparisonAnswer,
    DesignAnswer,
    DesignsAnswer,
    SolverLog,
    TaskList,
    TaskResult,
    Trajectory,
)
from shared.contracts.sweeps import AcceptedSweep, SweepItem, SweepList

DEFAULT_URL = "http://127.0.0.1:8000"

ProgressCallback = Callable[[ApplicationStatus], None]
"""Called with every status that `Application.wait` sees."""

RETRY_WAITS_S = (0.1, 0.2, 0.4, 0.8, 1.6)
"""Pauses before a call is tried again when nobody answers, or the server is busy (503)."""

TASKS_A_PAGE = 200
REPORT_TIMEOUT_S = 300.0
"""Reports are drawn one at a time."""
NOT_FOUND, BUSY = 404, 503


class Client:
    """A server's address, and what can be asked there.

    Parameters
    ----------
    url
        Such as ``http://127.0.0.1:8000``.
    api_key
        Where the server asks for one; None: ARMATURE_API_KEY of the environment, if it is set.
    timeout_s
        Longest wait for one answer [s].
    retry_waits_s
        Pauses between attempts [s]; every call is safe to repeat, a submission because it carries an idempotency key.
    transport
        Of httpx, for tests.
    """

    def __init__(
        self,
        url: str = DEFAULT_URL,
        *,
        api_key: str | None = None,
        timeout_s: float = 30.0,
        retry_waits_s: tuple[float, ...] = RETRY_WAITS_S,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self.url = url.rstrip("/")
        self._retry_waits_s = retry_waits_s
        key = os.environ.get("ARMATURE_API_KEY") if api_key is None else api_key
        headers = {"Authorization": f"Bearer {key}"} if key else {}
        self._http = httpx.Client(base_url=self.url, timeout=timeout_s, transport=transport, headers=headers)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def submit(self, application: str | Path | Mapping[str, Any], *, idempotency_key: str | None = None) -> Application:
        """Submit an application.

        Parameters
        ----------
        application
            Path of a YAML or JSON file, or its content.
        idempotency_key
            A second submission with the same key and content returns the first one's application. Made up when None.

        Raises
        ------
        RefusedError
            The server refused it, and says each field, value and limit; nothing was stored.
        ApplicationFileError
            The file cannot be read.
        ServerUnreachableError
            Nobody answers.
        """
        content = dict(application) if isinstance(application, Mapping) else read_application(application)
        answer = self._submit("/v1/applications", content, idempotency_key)
        return Application(self, Accepted.model_validate_json(answer).id)

    def submit_sweep(self, sweep: str | Path | Mapping[str, Any], *, idempotency_key: str | None = None) -> Sweep:
        """Submit a base application and axes over its fields; parameters and errors as those of `submit`."""
        content = dict(sweep) if isinstance(sweep, Mapping) else read_sweep(sweep)
        answer = self._submit("/v1/sweeps", content, idempotency_key)
        return Sweep(self, AcceptedSweep.model_validate_json(answer).id)

    def sweep(self, sweep_id: str) -> Sweep:
        """A sweep that was submitted before; whether it exists shows at the first question."""
        return Sweep(self, sweep_id)

    def sweeps(self) -> Iterator[SweepItem]:
        """All sweeps, newest first, fetched page by page as they are read."""
        cursor: str | None = None
        while True:
            page = SweepList.model_validate_json(self._get("/v1/sweeps", {"cursor": cursor}))
            yield from page.items
            if (cursor := page.next_cursor) is None:
                return

    def application(self, application_id: str) -> Application:
        """An application that was submitted before; whether it exists shows at the first question."""
        return Application(self, application_id)

    def applications(self, *, state: str | None = None, tag: str | None = None) -> Iterator[ApplicationItem]:
        """All applications, newest first, fetched page by page as they are read."""
        cursor: str | None = None
        while True:
            page = ApplicationList.model_validate_json(
                self._get("/v1/applications", {"cursor": cursor, "state": state, "tag": tag})
            )
            yield from page.items
            if (cursor := page.next_cursor) is None:
                return

    def robots(self) -> list[dict[str, str]]:
        """Presets and uploads: id, name, kind, description."""
        items: list[dict[str, str]] = json.loads(self._get("/v1/robots"))["items"]
        return items

    def robot(self, robot_id: str) -> dict[str, Any]:
        """A preset or an upload in the robot format."""
        found: dict[str, Any] = json.loads(self._get(f"/v1/robots/{quote(robot_id, safe='')}"))
        return found

    def upload_robot(self, robot: str | Path | Mapping[str, Any]) -> str:
        """Keep a robot on the server; returns its id, to be named in applications.

        Parameters
        ----------
        robot
            Path of a file or its content: the robot format, or a URDF (its text, or in a file its name) with settings.
        """
        content = dict(robot) if isinstance(robot, Mapping) else read_robot(robot)
        return str(self.request("POST", "/v1/robots", json=content).json()["id"])

    def delete_robot(self, robot_id: str) -> None:
        """Forget an upload; applications that use it keep their copy."""
        self.request("DELETE", f"/v1/robots/{quote(robot_id, safe='')}")

    def request(self, method: str, path: str, **options: Any) -> httpx.Response:
        """One call, repeated while nobody answers or the server is busy.

        A DELETE that is repeated and finds nothing was done the time before, when its answer was lost.

        Raises
        ------
        ServerUnreachableError
            Nobody answered, however often it was tried.
        ProblemError
            The answer was not a success.
        """
        for attempt, pause in enumerate((*self._retry_waits_s, None)):
            try:
                response = self._http.request(method, path, **options)
            except httpx.TransportError as error:
                if pause is None:
                    raise ServerUnreachableError(self.url, str(error) or type(error).__name__) from error
            else:
                deleted_before = method == "DELETE" and attempt > 0 and response.status_code == NOT_FOUND
                if response.is_success or deleted_before:
                    return response
                if response.status_code != BUSY or pause is None:
                    raise problem_of(response)
            time.sleep(pause)
        raise AssertionError("the last attempt returns or raises")

    def _submit(self, path: str, content: Mapping[str, Any], idempotency_key: str | None) -> bytes:
        key = idempotency_key or new_idempotency_key()
        # Values that JSON does not know (NaN, dates) travel as they are: the server names the field they are in.
        body = json.dumps(content, allow_nan=True, default=str)
        headers = {"Idempotency-Key": key, "Content-Type": "application/json"}
        return self.request("POST", path, content=body, headers=headers).content

    def _get(self, path: str, query: Mapping[str, Any] | None = None) -> bytes:
        given = {name: value for name, value in (query or {}).items() if value is not None}
        return self.request("GET", path, params=given).content


class Application:
    """An application on a server. Every method asks anew; nothing is kept."""

    def __init__(self, client: Client, application_id: str) -> None:
        self.client = client
        self.id = application_id
        self._path = f"/v1/applications/{quote(application_id, safe='')}"

    def __repr__(self) -> str:
        return f"Application({self.id!r} at {self.client.url})"

    def status(self) -> ApplicationStatus:
        """State, progress, time left, versions."""
        return ApplicationStatus.model_validate_json(self._get())

    def wait(
        self, progress: ProgressCallback | bool | None = None, *, timeout_s: float | None = None, poll_s: float = 0.5
    ) -> ApplicationStatus:
        """Wait for the end.

        Parameters
        ----------
        progress
            True: bars in the terminal; or a function that is called with every status seen.
        timeout_s
            Longest wait [s]; None: for ever.
        poll_s
            Pause between two questions [s].

        Returns
        -------
        ApplicationStatus
            The final one.

        Raises
        ------
        TimeoutError
            The application goes on without being waited for.
        """
        if progress is True:
            from armature.progress import shown_progress

            with shown_progress() as show:
                return self.wait(show, timeout_s=timeout_s, poll_s=poll_s)
        show_it = progress if callable(progress) else None
        return until_final(self.status, show_it, what=f"application {self.id}", timeout_s=timeout_s, poll_s=poll_s)

    def tasks(self) -> list[TaskResult]:
        """Every task with what is known of it so far, in order."""
        found: list[TaskResult] = []
        cursor: str | None = "0"
        while cursor is not None:
            page = TaskList.model_validate_json(self._get("/tasks", {"cursor": cursor, "limit": TASKS_A_PAGE}))
            found += page.items
            cursor = page.next_cursor
        return found

    def task(self, index: int) -> TaskResult:
        """One task."""
        return TaskResult.model_validate_json(self._get(f"/tasks/{index}"))

    def design(self, method: str | None = None) -> DesignAnswer:
        """The design for all tasks, motor by motor: dimensions, parameters, limits and what binds."""
        return DesignAnswer.model_validate_json(self._get("/design", {"method": method}))

    def designs(self) -> DesignsAnswer:
        """Every task's own design, their mean, and each method's design."""
        return DesignsAnswer.model_validate_json(self._get("/designs"))

    def comparison(self) -> ComparisonAnswer:
        """Methods side by side, per task and in total, and their regret."""
        return ComparisonAnswer.model_validate_json(self._get("/comparison"))

    def trajectory(self, task: int, method: str | None = None) -> Trajectory:
        """A motion on its grid: the task's own (`own`), or with a method's design (default: the application's)."""
        return Trajectory.model_validate_json(self._get(f"/tasks/{task}/trajectory", {"method": method}))

    def inputs(self) -> dict[str, Any]:
        """All that the results depend on: robot, motor, tasks and transcription with every default filled in."""
        found: dict[str, Any] = json.loads(self._get("/inputs"))
        return found

    def report(self) -> str:
        """The report: one HTML file that asks for nothing else. The server takes a few seconds to draw it."""
        answer = self.client.request("GET", f"{self._path}/report", timeout=REPORT_TIMEOUT_S)
        return answer.content.decode()

    def cancel(self) -> ApplicationStatus:
        """Ask for an end: queued jobs at once, running ones within a second or two."""
        return ApplicationStatus.model_validate_json(self.client.request("POST", f"{self._path}/cancel").content)

    def retry(self) -> ApplicationStatus:
        """Do again what failed, died or was cancelled, and what depends on it."""
        return ApplicationStatus.model_validate_json(self.client.request("POST", f"{self._path}/retry").content)

    def delete(self) -> None:
        """Delete the application with all its results; cancel it first while it runs."""
        self.client.request("DELETE", self._path)

    def log(self, task: int, method: str | None = None) -> SolverLog:
        """Solver iterations of a task's motion (method as in `trajectory`)."""
        return SolverLog.model_validate_json(self._get(f"/tasks/{task}/log", {"method": method}))

    def _get(self, path: str = "", query: Mapping[str, Any] | None = None) -> bytes:
        return self.client._get(f"{self._path}{path}", query)


def new_idempotency_key() -> str:
    """A key that no other submission has."""
    return uuid.uuid4().hex
