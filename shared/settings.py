"""Settings, from the environment: ARMATURE_HOME, ARMATURE_DATABASE_URL, and so on.

docs/operations.md has them as a table; `python docs/make_operations.py` writes it.
"""

from __future__ import annotations

import os
from pathlib import Path

from pydantic import Field, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict


class Settings(BaseSettings):
    """Everything that can be set; the defaults run embedded, in one folder, with no server."""

    model_config = SettingsConfigDict(env_prefix="ARMATURE_", frozen=True, use_attribute_docstrings=True)

    home: Path = Field(default_factory=lambda: Path.home() / ".armature")
    """Folder of the embedded database, the embedded broker and the compiled kernels."""
    database_url: str = ""
    """SQLAlchemy URL; empty: SQLite in `home`."""
    broker_url: str = ""
    """`redis://...`, or `embedded://FOLDER`; empty: embedded in `home`."""

    workers: int = Field(default_factory=lambda: os.cpu_count() or 1, ge=1)
    """Solver processes of one worker."""

    solver_niceness: int = Field(5, ge=0, le=19)
    """How far solver processes give way to whatever else wants a processor of their machine, the API and the database
    first of all: 0 not at all, 19 as far as can be. Where nothing else does, they lose nothing."""

    lease_s: float = Field(45.0, gt=0)
    """How long a claimed job belongs to its worker without a sign of life."""
    heartbeat_s: float = Field(10.0, gt=0)
    """How often a worker renews its lease."""
    cancel_poll_s: float = Field(1.0, gt=0)
    """How often a worker looks whether its job was cancelled."""
    drain_s: float = Field(20.0, ge=0)
    """How long a worker that is told to end lets its solves go on before it gives the jobs back."""
    max_attempts: int = Field(3, ge=1)
    """After how many lost workers a job is dead."""
    relay_poll_s: float = Field(0.05, gt=0)
    """How often the relay looks for messages to publish."""
    sweep_s: float = Field(5.0, gt=0)
    """How often expired leases and unclaimed jobs are looked for."""
    resend_after_s: float = Field(30.0, gt=0)
    """A published job that nobody claimed is sent again after this time, doubled each time, when the broker holds fewer
    messages than there are such jobs."""
    retention_days: float = Field(0.0, ge=0)
    """Finished applications are deleted with all they own after so many days; 0: they are kept for ever."""
    stuck_s: float = Field(900.0, gt=0)
    """A worker is called stuck when a job has waited for so long and none of its processes holds one."""
    shared_threads: int = Field(default_factory=lambda: os.cpu_count() or 1, ge=1)
    """Threads with which one process evaluates the program of all tasks (`shared_optimum`). That stage is one job, so
    the worker's other processes are idle unless other applications are queued; threads that wait do not spin, so that
    sharing the processors with them costs little."""
    solver_memory_mb: int = Field(2000, ge=1)
    """A solver process that has held more memory [MB] is replaced after the job in which it did. All tasks in
    one program (`shared_optimum`) take the most."""
    solve_time_limit_s: float = Field(600.0, gt=0)
    """Longest time one solve may take."""

    api_keys_required: bool = False
    """Whether every call under /v1 needs an API key (`armature key create`); each key sees what it submitted only."""
    session_hours: float = Field(168.0, gt=0)
    """How long a browser that showed a key stays logged in."""

    max_body_bytes: int = Field(2_000_000, ge=1)
    """Largest body of a request."""
    max_tasks: int = Field(2_000, ge=1)
    """Most tasks of one application."""
    max_sweep_points: int = Field(500, ge=1)
    """Most applications of one sweep."""
    max_points: int = Field(2_000, ge=1)
    """Most collocation points of a trajectory whose transcription is asked for (degree times intervals)."""
    max_queued_jobs: int = Field(20_000, ge=1)
    """Most jobs that wait or run for one key, or for everybody where no keys are asked for."""
    rate_per_minute: int = Field(12_000, ge=0)
    """Most requests a minute of one key (of one address, without keys) in each API process; 0: no limit."""

    @model_validator(mode="before")
    @classmethod
    def _embedded_by_default(cls, values: dict[str, object]) -> dict[str, object]:
        home = Path(str(values.get("home") or Path.home() / ".armature")).expanduser().absolute()
        return {
            **values,
            "home": home,
            "database_url": values.get("database_url") or f"sqlite:///{home / 'armature.db'}",
            "broker_url": values.get("broker_url") or f"embedded://{home / 'broker'}",
        }

    @property
    def kernel_cache(self) -> Path:
        """Folder of compiled kernels."""
        return self.home / "kernels"

    @property
    def embedded(self) -> bool:
        """Whether the database is the embedded one."""
        return self.database_url.startswith("sqlite")
