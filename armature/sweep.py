"""A sweep on a server: many applications, one table."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING
from urllib.parse import quote

from armature.waiting import until_final
from shared.contracts.sweeps import SweepStatus

if TYPE_CHECKING:
    from armature.client import Application, Client

SweepProgress = Callable[[SweepStatus], None]
"""Called with every status that `Sweep.wait` sees."""


class Sweep:
    """A sweep on a server. Every method asks anew; nothing is kept."""

    def __init__(self, client: Client, sweep_id: str) -> None:
        self.client = client
        self.id = sweep_id
        self._path = f"/v1/sweeps/{quote(sweep_id, safe='')}"

    def __repr__(self) -> str:
        return f"Sweep({self.id!r} at {self.client.url})"

    def status(self) -> SweepStatus:
        """State, and the table of results so far: a point for each combination of the axes' values."""
        return SweepStatus.model_validate_json(self.client.request("GET", self._path).content)

    def csv(self) -> str:
        """The table as CSV: a row for each application and method, lengths in mm, units in the columns' names."""
        return self.client.request("GET", self._path, headers={"Accept": "text/csv"}).text

    def wait(
        self, progress: SweepProgress | bool | None = None, *, timeout_s: float | None = None, poll_s: float = 1.0
    ) -> SweepStatus:
        """Wait until the last of the applications has ended.

        Parameters
        ----------
        progress
            True: a bar in the terminal; or a function that is called with every status seen.
        timeout_s
            Longest wait [s]; None: for ever.
        poll_s
            Pause between two questions [s].

        Raises
        ------
        TimeoutError
            The sweep goes on without being waited for.
        """
        if progress is True:
            from armature.sweep_progress import shown_sweep_progress

            with shown_sweep_progress() as show:
                return self.wait(show, timeout_s=timeout_s, poll_s=poll_s)
        show_it = progress if callable(progress) else None
        return until_final(self.status, show_it, what=f"sweep {self.id}", timeout_s=timeout_s, poll_s=poll_s)

    def applications(self) -> list[Application]:
        """The applications, in the order of the table."""
        return [self.client.application(point.application_id) for point in self.status().points]

    def cancel(self) -> SweepStatus:
        """Ask all of its applications to end; those at their end stay as they are."""
        return SweepStatus.model_validate_json(self.client.request("POST", f"{self._path}/cancel").content)

    def delete(self) -> None:
        """Delete the sweep with all its applications."""
        self.client.request("DELETE", self._path)
