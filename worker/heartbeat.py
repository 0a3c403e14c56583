"""What happens beside a solve: its lease is renewed, requests are looked for, iterations are reported."""

from __future__ import annotations

import threading
import time
from contextlib import suppress
from contextvars import Context, copy_context
from dataclasses import dataclass, field

import structlog
from sqlalchemy import Engine
from sqlalchemy.exc import SQLAlchemyError

from services.codesign.kernels import building
from services.codesign.solver import IterationReport
from services.jobs.claim import Claim, Requests, renew, report, report_compiling, requests_of
from shared.settings import Settings
from worker.drain import drained

log = structlog.get_logger()

LONGEST_BEAT_S = 5.0
"""A beat that takes longer hangs, on a database that does not answer: the next job does not wait for it."""


@dataclass(eq=False)
class Heartbeat:
    """Beats for one job while its `with` block lasts; the solver reads what it learns.

    The solver holds no lock of the interpreter while it factorises, so the thread lives (DESIGN: measured). A beat that
    ends after the job changes nothing: the token is old, or the job final.
    """

    engine: Engine
    settings: Settings
    held: Claim
    gave_up: bool = False
    """Whether the solve was stopped because the worker shuts down, and for no other reason."""
    search_stopped: threading.Event = field(default_factory=threading.Event)
    _latest: IterationReport | None = None
    _stop: threading.Event = field(default_factory=threading.Event)
    _renew_at: float = 0.0
    _compiling: bool = False
    _ids: Context = field(default_factory=copy_context)

    def __enter__(self) -> Heartbeat:
        self._renew_at = time.monotonic() + self.settings.heartbeat_s
        self._heart = _heart(self.settings.cancel_poll_s)
        self._heart.beating.add(self)
        return self

    def __exit__(self, *_: object) -> None:
        self._heart.beating.discard(self)

    def should_stop(self, iteration: IterationReport) -> bool:
        """For the solver."""
        self._latest = iteration
        if not self._stop.is_set() and drained():
            self.gave_up = True
        return self._stop.is_set() or self.gave_up

    def beat(self) -> None:
        """Once every `cancel_poll_s`, with the ids of the job in its log lines."""
        self._ids.run(self._beat)

    def _beat(self) -> None:
        try:
            if time.monotonic() >= self._renew_at:
                pulse = renew(self.engine, self.held, self.settings.lease_s)
                self._renew_at = time.monotonic() + self.settings.heartbeat_s  # one that failed is tried again soon
                self._heed(pulse, mine=pulse.mine)
            else:
                self._heed(requests_of(self.engine, self.held))
            self._report()
        except SQLAlchemyError as error:  # the database is away for a while: keep solving, the lease decides
            log.warning("heartbeat failed", error=str(error))
        except Exception:  # the next job needs this thread
            log.exception("heartbeat failed")

    def _heed(self, requests: Requests, *, mine: bool = True) -> None:
        if requests.search_stopped:
            self.search_stopped.set()
        if requests.cancelled or not mine:
            self._stop.set()

    def _report(self) -> None:
        if self._latest is not None:
            iteration, self._latest = self._latest, None
            report(self.engine, self.held, iteration)
        elif building() and not self._compiling:
            report_compiling(self.engine, self.held)
        self._compiling = building()


class _Heart:
    """The thread that lets the jobs at hand of this process beat: one for every job would cost a short one more than
    its solve."""

    def __init__(self, every_s: float) -> None:
        self.every_s, self.beating, self._began = every_s, set[Heartbeat](), time.monotonic()
        self._thread = threading.Thread(target=self._live, name="heartbeat", daemon=True)

    def start(self) -> None:
        """Once it is this process' own."""
        self._thread.start()

    @property
    def hangs(self) -> bool:
        """Whether the thread is gone, as after a fork, or has not come round for long."""
        return not self._thread.is_alive() or time.monotonic() - self._began > self.every_s + LONGEST_BEAT_S

    def _live(self) -> None:
        while _HEARTS.get(self.every_s) is self or self.beating:
            self._began = time.monotonic()
            time.sleep(self.every_s)
            for heartbeat in list(self.beating):
                with suppress(Exception):  # a log that cannot be written: the others need this thread
                    heartbeat.beat()


_HEARTS: dict[float, _Heart] = {}


def _heart(every_s: float) -> _Heart:
    heart = _HEARTS.get(every_s)
    if heart is None or heart.hangs:
        heart = _HEARTS[every_s] = _Heart(every_s)
        heart.start()
    return heart
