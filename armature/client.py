"""The Python client: submit applications to a server, wait for them, read their results.

from armature import Client

application = Client("http://127.0.0.1:8000").submit("examples/pick_and_place.yaml")
application.wait(progress=True)
print(application.results().design())

`armature.AsyncClient` is the same for programs that use asyncio. What is sent and how answers are read is in `calls`,
when a call is repeated in `retries`: this module adds the waiting.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

import httpx

from armature import calls
from armature.calls import DEFAULT_URL, Call, Content, new_idempotency_key
from armature.progress import shown_progress
from armature.results import Results
from armature.retries import PATIENCE_S, WAITS_S, Attempts, OnWait, Policy
from armature.sweep import Sweep
from armature.waiting import Progress, look_until_final
from shared.contracts.comparisons import ComparisonAnswer, DesignAnswer, DesignsAnswer
from shared.contracts.motions import SolverLog, TaskResult, Trajectory
from shared.contracts.states import ApplicationItem, ApplicationStatus
from shared.contracts.sweeps import SweepItem

__all__ = ["DEFAULT_URL", "Application", "Client", "new_idempotency_key"]

ProgressCallback = Callable[[ApplicationStatus], None]
"""Called with every status that `Application.wait` sees."""

Answer = TypeVar("Answer")


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
        Pauses between attempts [s] when nobody answers or the server is busy; every call is safe to repeat, a
        submission because it carries an idempotency key.
    patience_s
        How long a call waits in all [s] because the server said `Retry-After`, such as when its queue is full.
    on_wait
        Told of every such wait before it begins: how long [s], and why.
    transport
        Of httpx, for tests.
    """

    def __init__(
        self,
        url: str = DEFAULT_URL,
        *,
        api_key: str | None = None,
        timeout_s: float = 30.0,
        retry_waits_s: tuple[float, ...] = WAITS_S,
        patience_s: float = PATIENCE_S,
        on_wait: OnWait | None = None,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self.url = url.rstrip("/")
        self._policy = Policy(retry_waits_s, patience_s, on_wait)
        self._http = httpx.Client(
            base_url=self.url, timeout=timeout_s, transport=transport, headers=authorization(api_key)
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def submit(self, application: Content, *, idempotency_key: str | None = None) -> Application:
        """Submit an application.

        Parameters
        ----------
        application
            Path of a YAML or JSON file, its content, or an `ApplicationBuilder`.
        idempotency_key
            A second submission with the same key and content returns the first one's application. Made up when None.

        Raises
        ------
        RefusedError
            The server refused it, and says each field, value and limit; nothing was stored.
        TooManyRequestsError
            Its queue stays full.
        ApplicationFileError
            The file cannot be read.
        ServerUnreachableError
            Nobody answers.
        """
        return Application(self, self.send(calls.submit(application, idempotency_key)))

    def submit_sweep(self, sweep: Content, *, idempotency_key: str | None = None) -> Sweep:
        """Submit a base application and axes over its fields; parameters and errors as those of `submit`."""
        return Sweep(self, self.send(calls.submit_sweep(sweep, idempotency_key)))

    def sweep(self, sweep_id: str) -> Sweep:
        """A sweep that was submitted before; whether it exists shows at the first question."""
        return Sweep(self, sweep_id)

    def sweeps(self) -> Iterator[SweepItem]:
        """All sweeps, newest first, fetched page by page as they are read."""
        cursor: str | None = None
        while True:
            page = self.send(calls.sweeps(cursor))
            yield from page.items
            if (cursor := page.next_cursor) is None:
                return

    def application(self, application_id: str) -> Application:
        """An application that was submitted before; whether it exists shows at the first question."""
        return Application(self, application_id)

    def results(self, application_id: str) -> Results:
        """Results of an application as pandas data frames and numpy arrays."""
        return self.application(application_id).results()

    def applications(self, *, state: str | None = None, tag: str | None = None) -> Iterator[ApplicationItem]:
        """All applications, newest first, fetched page by page as they are read."""
        cursor: str | None = None
        while True:
            page = self.send(calls.applications(cursor, state, tag))
            yield from page.items
            if (cursor := page.next_cursor) is None:
                return

    def robots(self) -> list[dict[str, str]]:
        """Presets and uploads: id, name, kind, description."""
        return self.send(calls.robots())

    def robot(self, robot_id: str) -> dict[str, Any]:
        """A preset or an upload in the robot format."""
        return self.send(calls.robot(robot_id))

    def upload_robot(self, robot: str | Path | Mapping[str, Any]) -> str:
        """Keep a robot on the server; returns its id, to be named in applications.

        Parameters
        ----------
        robot
            Path of a file or its content: the robot format, or a URDF (its text, or in a file its name) with settings.
        """
        return self.send(calls.upload_robot(robot))

    def delete_robot(self, robot_id: str) -> None:
        """Forget an upload; applications that use it keep their copy."""
        self.send(calls.delete_robot(robot_id))

    def send(self, call: Call[Answer]) -> Answer:
        """Ask, and again while nobody answers or the server is busy.

        Raises
        ------
        ServerUnreachableError
            Nobody answered, however often it was tried.
        ProblemError
            The answer was not a success.
        """
        attempts = Attempts(call.method, self.url, self._policy)
        while True:
            try:
                answer = self._http.request(**call.options())
            except httpx.TransportError as error:
                pause: float | None = attempts.after_error(error)
            else:
                pause = attempts.after_answer(answer)
            if pause is None:
                return call.read(answer)
            time.sleep(pause)


def authorization(api_key: str | None) -> dict[str, str]:
    """Headers that show a key: the one given, or the environment's, or none."""
    key = os.environ.get("ARMATURE_API_KEY") if api_key is None else api_key
    return {"Authorization": f"Bearer {key}"} if key else {}


class Application:
    """An application on a server. Every method asks anew; nothing is kept."""

    def __init__(self, client: Client, application_id: str) -> None:
        self.client = client
        self.id = application_id

    def __repr__(self) -> str:
        return f"Application({self.id!r} at {self.client.url})"

    def status(self) -> ApplicationStatus:
        """State, progress, time left, versions."""
        return self.client.send(calls.status(self.id))

    def wait(
        self,
        progress: Progress[ApplicationStatus] = None,
        *,
        timeout_s: float | None = None,
        poll_s: float = 0.5,
    ) -> ApplicationStatus:
        """Wait for the end.

        Parameters
        ----------
        progress
            True: bars in the terminal or notebook; or a function that is called with every status seen.
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
        what = f"application {self.id}"
        with look_until_final(progress, shown_progress, what=what, timeout_s=timeout_s) as over:
            while not over(status := self.status()):
                time.sleep(poll_s)
        return status

    def results(self) -> Results:
        """Results as pandas data frames and numpy arrays."""
        return Results(self)

    def tasks(self) -> list[TaskResult]:
        """Every task with what is known of it so far, in order."""
        found: list[TaskResult] = []
        cursor: str | None = None
        while True:
            page = self.client.send(calls.tasks(self.id, cursor))
            found += page.items
            if (cursor := page.next_cursor) is None:
                return found

    def task(self, index: int) -> TaskResult:
        """One task."""
        return self.client.send(calls.task(self.id, index))

    def design(self, method: str | None = None) -> DesignAnswer:
        """The design for all tasks, motor by motor: dimensions, parameters, limits and what binds."""
        return self.client.send(calls.design(self.id, method))

    def designs(self) -> DesignsAnswer:
        """Every task's own design, their mean, and each method's design."""
        return self.client.send(calls.designs(self.id))

    def comparison(self) -> ComparisonAnswer:
        """Methods side by side, per task and in total, and their regret."""
        return self.client.send(calls.comparison(self.id))

    def trajectory(self, task: int, method: str | None = None) -> Trajectory:
        """A motion on its grid: the task's own (`own`), or with a method's design (default: the application's)."""
        return self.client.send(calls.trajectory(self.id, task, method))

    def inputs(self) -> dict[str, Any]:
        """All that the results depend on: robot, motor, tasks and transcription with every default filled in."""
        return self.client.send(calls.inputs(self.id))

    def report(self) -> str:
        """The report: one HTML file that asks for nothing else. The server takes a few seconds to draw it."""
        return self.client.send(calls.report(self.id))

    def cancel(self) -> ApplicationStatus:
        """Ask for an end: queued jobs at once, running ones within a second or two."""
        return self.client.send(calls.cancel(self.id))

    def stop_search(self) -> ApplicationStatus:
        """End the search for a shared design: the best one found so far is used, and the application goes on."""
        return self.client.send(calls.stop_search(self.id))

    def retry(self) -> ApplicationStatus:
        """Do again what failed, died or was cancelled, and what depends on it."""
        return self.client.send(calls.retry(self.id))

    def delete(self) -> None:
        """Delete the application with all its results; cancel it first while it runs."""
        self.client.send(calls.delete(self.id))

    def log(self, task: int, method: str | None = None) -> SolverLog:
        """Solver iterations of a task's motion (method as in `trajectory`)."""
        return self.client.send(calls.log(self.id, task, method))
