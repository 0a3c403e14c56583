"""What happens beside a solve: its lease is renewed, requests are looked for, iterations are reported."""

from __future__ import annotations

import threading
import time
from contextvars import Context, copy_context
from dataclasses import dataclass, field
from functools import cache

import structlog
from sqlalchemy import Engine
from sqlalchemy.exc import SQLAlchemyError

from services.codesign.kernels import building
from services.codesign.solver import IterationReport
from services.jobs.claim import Claim, Requests, renew, report, report_compiling, requests_of
from shared.settings import Settings
from worker.drain import drained

log = structlog.get_logger()


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
    _waited: float = 0.0
    _compiling: bool = False
    _ids: Context = field(default_factory=copy_context)

    def __enter__(self) -> Heartbeat:
        self._heart = _heart(self.settings.cancel_poll_s)
        self._heart.add(self)
        return self

    def __exit__(self, *_: object) -> None:
        self._heart.discard(self)

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
        self._waited += self.settings.cancel_poll_s
        try:
            if self._waited >= self.settings.heartbeat_s:
                self._waited = 0.0
                pulse = renew(self.engine, self.held, self.settings.lease_s)
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


@cache
def _heart(every_s: float) -> set[Heartbeat]:
    """The jobs at hand of this process; a thread lets each of them beat. One for every job would cost a short one more
    than its solve."""
    beating: set[Heartbeat] = set()

    def live() -> None:
        while True:
            time.sleep(every_s)
            for heartbeat in list(beating):
                heartbeat.beat()

    threading.Thread(target=live, name="heartbeat", daemon=True).start()
    return beating
