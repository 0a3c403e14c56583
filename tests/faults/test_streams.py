"""Live events over connections that break, from an API that is killed and started again."""

from __future__ import annotations

import json
from collections.abc import Iterator

import httpx
from sqlalchemy import func, select

from shared.db.engine import reading
from shared.db.tables import Event as EventRow
from tests.faults.conftest import Count, Measured
from tests.faults.history import assert_true_to_its_word
from tests.faults.service import START_S, Service, kill_family, wait_until
from tests.faults.test_stopping import NO_LEASE_LOST

Event = tuple[int, str, dict[str, object]]
"""Number, kind, content."""

NEVER_S = 600.0
SILENCE_S = 60.0
"""A stream that says nothing for so long, not even that it lives, is broken."""
KILL_THE_API_EVERY = 5
"""Cuts; the others are the client's own."""


def test_a_stream_of_events_cut_again_and_again(service: Service, count: Count, measured: Measured) -> None:
    """Cut by the client or with the API, while solves report iterations: nothing is missing, nothing comes twice."""
    cuts = count("streams cut")
    service.solves_take(NEVER_S)
    http = service.start_api()
    service.start("relay")
    service.start("worker", **NO_LEASE_LOST)
    application_id = service.submit(2)
    wait_until(lambda: len(service.held()) == 2, START_S)
    wait_until(lambda: _reported(service), START_S)
    heard: list[Event] = []
    for cut in range(1, cuts + 1):
        if cut == cuts // 2:
            service.solves_take(0.0)  # the second half comes while one stage follows the other, and after the end
        api_dies = cut % KILL_THE_API_EVERY == 0
        for event in _follow(http, application_id, heard):
            heard.append(event)
            if api_dies:
                kill_family(service.latest("api"))
            break
        if api_dies:
            http = service.start_api()
    heard += _follow(http, application_id, heard)
    service.wait_for_the_end()
    assert heard == list(_follow(http, application_id, []))
    assert [number for number, _, _ in heard] == list(range(1, len(heard) + 1))
    assert heard[-1][1] == "application"
    assert heard[-1][2]["state"] == "succeeded"
    assert sum(kind == "iteration" for _, kind, _ in heard) > 0
    assert_true_to_its_word(service.engine, service.accepted)
    measured(f"{len(heard)} events over {cuts} cut streams, {cuts // KILL_THE_API_EVERY} of them by a killed API")


def _reported(service: Service) -> bool:
    """Whether a solve has told of an iteration."""
    with reading(service.engine) as session:
        return session.scalar(select(func.count()).where(EventRow.kind == "iteration")) > 0


def _follow(http: httpx.Client, application_id: str, heard: list[Event]) -> Iterator[Event]:
    """Events after those that were heard, until the stream ends."""
    last = {"Last-Event-ID": str(heard[-1][0])} if heard else {}
    with http.stream("GET", f"/v1/applications/{application_id}/events", headers=last, timeout=SILENCE_S) as stream:
        assert stream.status_code == 200
        fields: dict[str, str] = {}
        for line in stream.iter_lines():
            name, _, value = line.partition(": ")
            if line and name:  # a line that begins with a colon is a sign of life
                fields[name] = value
            elif fields:
                yield int(fields["id"]), fields["event"], json.loads(fields["data"])
                fields = {}
