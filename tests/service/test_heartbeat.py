"""One thread of a process lets its jobs beat, whatever becomes of a beat."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest
from sqlalchemy import Engine
from sqlalchemy.exc import OperationalError

import worker.heartbeat
from services.jobs.claim import Pulse
from services.jobs.submit import submit
from shared.settings import Settings
from tests.service.queue_actions import take
from tests.service.requests import application
from worker.heartbeat import Heartbeat

QUICK = {"cancel_poll_s": 0.01, "heartbeat_s": 0.05}


def comes(true: Callable[[], bool], patience_s: float = 30.0) -> bool:
    deadline = time.monotonic() + patience_s
    while not true() and time.monotonic() < deadline:
        time.sleep(0.01)
    return true()


@pytest.fixture(autouse=True)
def no_thread_of_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker.heartbeat, "_HEARTS", {})


@pytest.fixture
def heartbeat(engine: Engine, settings: Settings) -> Heartbeat:
    submit(engine, settings, application())
    return Heartbeat(engine, settings.model_copy(update=QUICK), take(engine))


def test_jobs_one_after_the_other_have_one_thread(heartbeat: Heartbeat) -> None:
    before, seen = set(threading.enumerate()), set()
    for _ in range(3):
        with heartbeat:
            seen |= {thread for thread in threading.enumerate() if thread.name == "heartbeat"}
    assert len(seen - before) == 1


def test_a_log_that_cannot_be_written_stops_no_heartbeat(heartbeat: Heartbeat, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that is full fails the database first and then the line that says so."""
    full, renewed = [True], []

    def renew(*arguments: Any) -> Pulse:
        if full:
            raise OperationalError("renew", None, Exception("disk is full"))
        renewed.append(arguments)
        return Pulse(cancelled=False, search_stopped=False, mine=True)

    class Full:
        def __getattr__(self, _: str) -> Any:
            raise OSError("no space left on device")

    monkeypatch.setattr(worker.heartbeat, "renew", renew)
    monkeypatch.setattr(worker.heartbeat, "log", Full())
    with heartbeat:
        time.sleep(0.2)
        full.clear()
        assert comes(lambda: len(renewed) > 1)


def test_a_renewal_that_failed_is_tried_again_at_the_next_beat(
    heartbeat: Heartbeat, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[float] = []

    def renew(*_: Any) -> Pulse:
        tried.append(time.monotonic())
        raise OperationalError("renew", None, Exception("away"))

    monkeypatch.setattr(worker.heartbeat, "renew", renew)
    seldom = replace(heartbeat, settings=heartbeat.settings.model_copy(update={"heartbeat_s": 1.0}))
    with seldom:
        assert comes(lambda: len(tried) > 10)
    assert min(later - earlier for earlier, later in pairwise(tried)) < 0.5


def test_a_beat_that_hangs_leaves_the_next_job_its_own(heartbeat: Heartbeat, monkeypatch: pytest.MonkeyPatch) -> None:
    release, beating, renewed = threading.Event(), threading.Event(), threading.Event()

    def hang(*_: Any) -> Pulse:
        beating.set()
        release.wait()
        raise OperationalError("renew", None, Exception("away"))

    def answer(*_: Any) -> Pulse:
        renewed.set()
        return Pulse(cancelled=False, search_stopped=False, mine=True)

    monkeypatch.setattr(worker.heartbeat, "LONGEST_BEAT_S", 0.1)
    monkeypatch.setattr(worker.heartbeat, "renew", hang)
    with heartbeat:
        assert beating.wait(30.0)
        hanging = {thread for thread in threading.enumerate() if thread.name == "heartbeat"}
    time.sleep(0.2)
    monkeypatch.setattr(worker.heartbeat, "renew", answer)
    with Heartbeat(heartbeat.engine, heartbeat.settings, heartbeat.held):
        assert renewed.wait(30.0)
    release.set()
    assert comes(lambda: not any(thread.is_alive() for thread in hanging)), "it ends when it is free"
