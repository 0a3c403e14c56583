"""Results of an application as pandas data frames and numpy arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armature import frames
from armature.export.motion_columns import motion_arrays

if TYPE_CHECKING:
    import pandas as pd

    from armature.async_client import AsyncApplication
    from armature.client import Application


class Results:
    """Results of an application; every method asks anew.

    Data frames need pandas (`pip install 'armature-codesign[tables]'`), else they raise `MissingExtraError`.
    """

    def __init__(self, application: Application) -> None:
        self._application = application

    def tasks(self) -> pd.DataFrame:
        """A row a motion, by `task` and `method`: what it costs, how the solve went, its certificate.

        A task without a motion has one row, `own`, with the reason why.
        """
        return frames.tasks_frame(self._application.tasks())

    def design(self, method: str | None = None) -> pd.DataFrame:
        """A row a motor, by `joint`: lengths, derived parameters, and what binds."""
        return frames.design_frame(self._application.design(method))

    def designs(self) -> pd.DataFrame:
        """A row a motor of every design, by `design` (own, mean, a method), `task` and `joint`."""
        return frames.designs_frame(self._application.designs())

    def comparison(self) -> pd.DataFrame:
        """A row a method: totals over the tasks that every method solved, and the regret as a share of the bound."""
        return frames.comparison_frame(self._application.comparison())

    def regret(self) -> pd.DataFrame:
        """A row a task, a column a method: by what share the objective is over that of the task's own design."""
        return frames.regret_frame(self._application.comparison())

    def motion(self, task: int, method: str | None = None) -> pd.DataFrame:
        """A row a point, by `time_s`: position, speed, torque, currents and voltages of each joint, from 1."""
        return frames.motion_frame(self._application.trajectory(task, method))

    def arrays(self, task: int, method: str | None = None) -> dict[str, np.ndarray]:
        """A motion as arrays: `time_s` (points,), and every quantity (points, joints); pandas is not needed."""
        return motion_arrays(self._application.trajectory(task, method))


class AsyncResults:
    """As `Results`, awaited."""

    def __init__(self, application: AsyncApplication) -> None:
        self._application = application

    async def tasks(self) -> pd.DataFrame:
        """A row a motion, by `task` and `method`."""
        return frames.tasks_frame(await self._application.tasks())

    async def design(self, method: str | None = None) -> pd.DataFrame:
        """A row a motor, by `joint`."""
        return frames.design_frame(await self._application.design(method))

    async def designs(self) -> pd.DataFrame:
        """A row a motor of every design."""
        return frames.designs_frame(await self._application.designs())

    async def comparison(self) -> pd.DataFrame:
        """A row a method."""
        return frames.comparison_frame(await self._application.comparison())

    async def regret(self) -> pd.DataFrame:
        """A row a task, a column a method."""
        return frames.regret_frame(await self._application.comparison())

    async def motion(self, task: int, method: str | None = None) -> pd.DataFrame:
        """A row a point, by `time_s`."""
        return frames.motion_frame(await self._application.trajectory(task, method))

    async def arrays(self, task: int, method: str | None = None) -> dict[str, np.ndarray]:
        """A motion as arrays: `time_s` (points,), and every quantity (points, joints)."""
        return motion_arrays(await self._application.trajectory(task, method))
