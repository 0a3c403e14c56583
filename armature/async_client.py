"""The client for programs that use asyncio: the same calls, awaited.

from armature import AsyncClient

async with AsyncClient("http://127.0.0.1:8000") as client:
    application = await client.submit("examples/pick_and_place.yaml")
    await application.wait(progress=True)
    print(await application.results().design())
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TypeVar

import httpx

from armature import calls
from armature.calls import DEFAULT_URL, Call, Content
from armature.client import authorization
from armature.frames import sweep_frame
from armature.progress import shown_progress
from armature.results import AsyncResults
from armature.retries import PATIENCE_S, WAITS_S, Attempts, OnWait, Policy
from armature.sweep_progress import shown_sweep_progress
from armature.waiting import Progress, look_until_final
from shared.contracts.comparisons import ComparisonAnswer, DesignAnswer, DesignsAnswer
from shared.contracts.motions import SolverLog, TaskResult, Trajectory
from shared.contracts.states import ApplicationItem, ApplicationStatus
from shared.contracts.sweeps import SweepItem, SweepStatus

if TYPE_CHECKING:
    import pandas as pd

Answer = TypeVar("Answer")


class AsyncClient:
    """A server's address, and what can be asked there; parameters and errors as those of `Client`."""

    def __init__(
        self,
        url: str = DEFAULT_URL,
        *,
        api_key: str | None = None,
        timeout_s: float = 30.0,
        retry_waits_s: tuple[float, ...] = WAITS_S,
        patience_s: float = PATIENCE_S,
        on_wait: OnWait | None = None,
        transport: httpx.AsyncBaseTransport | None = None,
    ) -> None:
        self.url = url.rstrip("/")
        self._policy = Policy(retry_waits_s, patience_s, on_wait)
        self._http = httpx.AsyncClient(
            base_url=self.url, timeout=timeout_s, transport=transport, headers=authorization(api_key)
        )

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections."""
        await self._http.aclose()

    async def submit(self, application: Content, *, idempotency_key: str | None = None) -> AsyncApplication:
        """Submit an application; parameters and errors as those of `Client.submit`."""
        return AsyncApplication(self, await self.send(calls.submit(application, idempotency_key)))

    async def submit_sweep(self, sweep: Content, *, idempotency_key: str | None = None) -> AsyncSweep:
        """Submit a base application and axes over its fields."""
        return AsyncSweep(self, await self.send(calls.submit_sweep(sweep, idempotency_key)))

    def sweep(self, sweep_id: str) -> AsyncSweep:
        """A sweep that was submitted before; whether it exists shows at the first question."""
        return AsyncSweep(self, sweep_id)

    async def sweeps(self) -> AsyncIterator[SweepItem]:
        """All sweeps, newest first, fetched page by page as they are read."""
        cursor: str | None = None
        while True:
            page = await self.send(calls.sweeps(cursor))
            for item in page.items:
                yield item
            if (cursor := page.next_cursor) is None:
                return

    def application(self, application_id: str) -> AsyncApplication:
        """An application that was submitted before; whether it exists shows at the first question."""
        return AsyncApplication(self, application_id)

    def results(self, application_id: str) -> AsyncResults:
        """Results of an application as pandas data frames and numpy arrays."""
        return self.application(application_id).results()

    async def applications(self, *, state: str | None = None, tag: str | None = None) -> AsyncIterator[ApplicationItem]:
        """All applications, newest first, fetched page by page as they are read."""
        cursor: str | None = None
        while True:
            page = await self.send(calls.applications(cursor, state, tag))
            for item in page.items:
                yield item
            if (cursor := page.next_cursor) is None:
                return

    async def robots(self) -> list[dict[str, str]]:
        """Presets and uploads: id, name, kind, description."""
        return await self.send(calls.robots())

    async def robot(self, robot_id: str) -> dict[str, Any]:
        """A preset or an upload in the robot format."""
        return await self.send(calls.robot(robot_id))

    async def upload_robot(self, robot: str | Path | Mapping[str, Any]) -> str:
        """Keep a robot on the server; returns its id, to be named in applications."""
        return await self.send(calls.upload_robot(robot))

    async def delete_robot(self, robot_id: str) -> None:
        """Forget an upload; applications that use it keep their copy."""
        await self.send(calls.delete_robot(robot_id))

    async def send(self, call: Call[Answer]) -> Answer:
        """Ask, and again while nobody answers or the server is busy; errors as those of `Client.send`."""
        attempts = Attempts(call.method, self.url, self._policy)
        while True:
            try:
                answer = await self._http.request(**call.options())
            except httpx.TransportError as error:
                pause: float | None = attempts.after_error(error)
            else:
                pause = attempts.after_answer(answer)
            if pause is None:
                return call.read(answer)
            await asyncio.sleep(pause)


class AsyncApplication:
    """An application on a server. Every method asks anew; nothing is kept."""

    def __init__(self, client: AsyncClient, application_id: str) -> None:
        self.client = client
        self.id = application_id

    def __repr__(self) -> str:
        return f"AsyncApplication({self.id!r} at {self.client.url})"

    async def status(self) -> ApplicationStatus:
        """State, progress, time left, versions."""
        return await self.client.send(calls.status(self.id))

    async def wait(
        self,
        progress: Progress[ApplicationStatus] = None,
        *,
        timeout_s: float | None = None,
        poll_s: float = 0.5,
    ) -> ApplicationStatus:
        """Wait for the end; parameters and errors as those of `Application.wait`."""
        what = f"application {self.id}"
        with look_until_final(progress, shown_progress, what=what, timeout_s=timeout_s) as over:
            while not over(status := await self.status()):
                await asyncio.sleep(poll_s)
        return status

    def results(self) -> AsyncResults:
        """Results as pandas data frames and numpy arrays."""
        return AsyncResults(self)

    async def tasks(self) -> list[TaskResult]:
        """Every task with what is known of it so far, in order."""
        found: list[TaskResult] = []
        cursor: str | None = None
        while True:
            page = await self.client.send(calls.tasks(self.id, cursor))
            found += page.items
            if (cursor := page.next_cursor) is None:
                return found

    async def task(self, index: int) -> TaskResult:
        """One task."""
        return await self.client.send(calls.task(self.id, index))

    async def design(self, method: str | None = None) -> DesignAnswer:
        """The design for all tasks, motor by motor: dimensions, parameters, limits and what binds."""
        return await self.client.send(calls.design(self.id, method))

    async def designs(self) -> DesignsAnswer:
        """Every task's own design, their mean, and each method's design."""
        return await self.client.send(calls.designs(self.id))

    async def comparison(self) -> ComparisonAnswer:
        """Methods side by side, per task and in total, and their regret."""
        return await self.client.send(calls.comparison(self.id))

    async def trajectory(self, task: int, method: str | None = None) -> Trajectory:
        """A motion on its grid: the task's own (`own`), or with a method's design (default: the application's)."""
        return await self.client.send(calls.trajectory(self.id, task, method))

    async def inputs(self) -> dict[str, Any]:
        """All that the results depend on, with every default filled in."""
        return await self.client.send(calls.inputs(self.id))

    async def report(self) -> str:
        """The report: one HTML file that asks for nothing else."""
        return await self.client.send(calls.report(self.id))

    async def cancel(self) -> ApplicationStatus:
        """Ask for an end: queued jobs at once, running ones within a second or two."""
        return await self.client.send(calls.cancel(self.id))

    async def stop_search(self) -> ApplicationStatus:
        """End the search for a shared design: the best one found so far is used, and the application goes on."""
        return await self.client.send(calls.stop_search(self.id))

    async def retry(self) -> ApplicationStatus:
        """Do again what failed, died or was cancelled, and what depends on it."""
        return await self.client.send(calls.retry(self.id))

    async def delete(self) -> None:
        """Delete the application with all its results; cancel it first while it runs."""
        await self.client.send(calls.delete(self.id))

    async def log(self, task: int, method: str | None = None) -> SolverLog:
        """Solver iterations of a task's motion (method as in `trajectory`)."""
        return await self.client.send(calls.log(self.id, task, method))


class AsyncSweep:
    """A sweep on a server. Every method asks anew; nothing is kept."""

    def __init__(self, client: AsyncClient, sweep_id: str) -> None:
        self.client = client
        self.id = sweep_id

    def __repr__(self) -> str:
        return f"AsyncSweep({self.id!r} at {self.client.url})"

    async def status(self) -> SweepStatus:
        """State, and the table of results so far: a point for each combination of the axes' values."""
        return await self.client.send(calls.sweep_status(self.id))

    async def csv(self) -> str:
        """The table as CSV: a row for each application and method."""
        return await self.client.send(calls.sweep_csv(self.id))

    async def frame(self) -> pd.DataFrame:
        """The table of `csv` as a data frame."""
        return sweep_frame(await self.csv())

    async def wait(
        self,
        progress: Progress[SweepStatus] = None,
        *,
        timeout_s: float | None = None,
        poll_s: float = 1.0,
    ) -> SweepStatus:
        """Wait until the last of the applications has ended; as `Sweep.wait`."""
        what = f"sweep {self.id}"
        with look_until_final(progress, shown_sweep_progress, what=what, timeout_s=timeout_s) as over:
            while not over(status := await self.status()):
                await asyncio.sleep(poll_s)
        return status

    async def applications(self) -> list[AsyncApplication]:
        """The applications, in the order of the table."""
        return [self.client.application(point.application_id) for point in (await self.status()).points]

    async def cancel(self) -> SweepStatus:
        """Ask all of its applications to end; those at their end stay as they are."""
        return await self.client.send(calls.cancel_sweep(self.id))

    async def delete(self) -> None:
        """Delete the sweep with all its applications."""
        await self.client.send(calls.delete_sweep(self.id))
