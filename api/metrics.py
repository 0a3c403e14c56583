"""Prometheus metrics: requests as this process counts them, and the queue as the database knows it.

Every API process tells the same of the queue, whichever is asked; requests have to be summed over the processes.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import accumulate

from prometheus_client import CollectorRegistry, Counter, Histogram
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector
from sqlalchemy import Engine
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from services.jobs.queue import queue_depth
from services.jobs.tally import SOLVE_SECONDS, read_tallies
from services.jobs.workers import list_workers
from shared.domain import TRANSITIONS, JobState

NO_ROUTE = "none"
"""Of a path that no route answers: people can make up any number of those."""


class RequestMetrics:
    """ASGI middleware, outermost: counts answers, and times them to their first byte (a stream goes on for long)."""

    def __init__(self, app: ASGIApp, registry: CollectorRegistry) -> None:
        self.app = app
        labels = ("method", "route")
        self._requests = Counter("armature_http_requests", "answers", (*labels, "status"), registry=registry)
        self._seconds = Histogram("armature_http_request_seconds", "time to the answer", labels, registry=registry)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, and count how it was answered."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        began, seconds, status = time.perf_counter(), 0.0, 500

        async def watched(message: Message) -> None:
            nonlocal seconds, status
            if message["type"] == "http.response.start":
                status, seconds = message["status"], time.perf_counter() - began
            await send(message)

        try:
            await self.app(scope, receive, watched)
        finally:
            place = (scope["method"] if scope["method"] in METHODS else "other", _route(scope))
            self._requests.labels(*place, str(status)).inc()
            self._seconds.labels(*place).observe(seconds or time.perf_counter() - began)


METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})


def _route(scope: Scope) -> str:
    return str(getattr(scope.get("route"), "path", NO_ROUTE))


class QueueCollector(Collector):
    """Reads the database when it is asked; counters come from the running sums of `services.jobs.tally`."""

    def __init__(self, engine: Engine, seen_within_s: float) -> None:
        self._engine, self._seen_within_s = engine, seen_within_s

    def describe(self) -> list[Metric]:
        """Nothing: registering must not ask the database."""
        return []

    def collect(self) -> Iterator[Metric]:
        """Called by the registry."""
        depth, sums = queue_depth(self._engine), read_tallies(self._engine)
        jobs = GaugeMetricFamily("armature_jobs", "jobs by state", labels=["state"])
        jobs.add_metric(["queued"], depth.queued)
        jobs.add_metric(["running"], depth.running)
        yield jobs
        age = "age of the oldest queued job"
        yield GaugeMetricFamily("armature_oldest_queued_age_seconds", age, value=depth.oldest_queued_age_s)

        moved = CounterMetricFamily("armature_job_transitions", "jobs from state to state", labels=["from", "to"])
        for source, targets in TRANSITIONS.items():
            for to in sorted(targets):
                moved.add_metric([source, to], sums.transitions.get((source, to), 0.0))
        yield moved
        claims = sums.transitions.get((JobState.QUEUED, JobState.RUNNING), 0.0)
        yield CounterMetricFamily("armature_claims", "jobs claimed by workers", value=claims)
        expired = "leases that ended without a sign of life"
        yield CounterMetricFamily("armature_lease_expiries", expired, value=sums.lease_expiries)
        finished = CounterMetricFamily("armature_jobs_finished", "jobs by their final state", labels=["state"])
        for state in JobState:
            if state.final:
                ends = sum(count for (_, to), count in sums.transitions.items() if to == state)
                finished.add_metric([state], ends)
        yield finished
        bounds = [*(str(bound) for bound in SOLVE_SECONDS), "+Inf"]
        buckets = list(zip(bounds, accumulate(sums.solve_buckets), strict=True))
        yield HistogramMetricFamily(
            "armature_solve_seconds", "solver time of a job", buckets=buckets, sum_value=sums.solve_seconds
        )

        workers = [worker for worker in list_workers(self._engine) if worker.silent_s < self._seen_within_s]
        yield GaugeMetricFamily("armature_workers", "workers seen lately", value=len(workers))
        processes = sum(worker.processes for worker in workers)
        yield GaugeMetricFamily("armature_worker_processes", "their solver processes", value=processes)
