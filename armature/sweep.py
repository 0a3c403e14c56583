"""A sweep on a server: many applications, one table."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from armature import calls
from armature.frames import sweep_frame
from armature.sweep_progress import shown_sweep_progress
from armature.waiting import Progress, look_until_final
from shared.contracts.sweeps import SweepStatus

if TYPE_CHECKING:
    import pandas as pd

    from armature.client import Application, Client

SweepProgress = Callable[[SweepStatus], None]
"""Called with every status that `Sweep.wait` sees."""


class Sweep:
    """A sweep on a server. Every method asks anew; nothing is kept."""

    def __init__(self, client: Client, sweep_id: str) -> None:
        self.client = client
        self.id = sweep_id

    def __repr__(self) -> str:
        return f"Sweep({self.id!r} at {self.client.url})"

    def status(self) -> SweepStatus:
        """State, and the table of results so far: a point for each combination of the axes' values."""
        return self.client.send(calls.sweep_status(self.id))

    def csv(self) -> str:
        """The table as CSV: a row for each application and method, lengths in mm, units in the columns' names."""
        return self.client.send(calls.sweep_csv(self.id))

    def frame(self) -> pd.DataFrame:
        """The table of `csv` as a data frame.

        Raises
        ------
        MissingExtraError
            pandas is not installed.
        """
        return sweep_frame(self.csv())

    def wait(
        self,
        progress: Progress[SweepStatus] = None,
        *,
        timeout_s: float | None = None,
        poll_s: float = 1.0,
    ) -> SweepStatus:
        """Wait until the last of the applications has ended.

        Parameters
        ----------
        progress
            True: a bar in the terminal or notebook; or a function that is called with every status seen.
        timeout_s
            Longest wait [s]; None: for ever.
        poll_s
            Pause between two questions [s].

        Raises
        ------
        TimeoutError
            The sweep goes on without being waited for.
        """
        what = f"sweep {self.id}"
        with look_until_final(progress, shown_sweep_progress, what=what, timeout_s=timeout_s) as over:
            while not over(status := self.status()):
                time.sleep(poll_s)
        return status

    def applications(self) -> list[Application]:
        """The applications, in the order of the table."""
        return [self.client.application(point.application_id) for point in self.status().points]

    def cancel(self) -> SweepStatus:
        """Ask all of its applications to end; those at their end stay as they are."""
        return self.client.send(calls.cancel_sweep(self.id))

    def delete(self) -> None:
        """Delete the sweep with all its applications."""
        self.client.send(calls.delete_sweep(self.id))
