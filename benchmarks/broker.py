"""Latency, throughput and idle cost of a broker: `python benchmarks/broker.py [URL] [--messages 10000]`.

Without a URL it measures the embedded broker in a temporary folder. Fill the queue first, then measure the drain.
"""

from __future__ import annotations

import argparse
import os
import random
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from celery import shared_task

from shared.dispatch.broker import celery_app, send, worker_arguments

QUEUE = "armature-benchmark"
TASK = "benchmark.noop"
RECORD = "ARMATURE_BENCHMARK_RECORD"
IDLE_S = 20.0
PROBES = 60


@shared_task(name=TASK)  # type: ignore[untyped-decorator]
def noop(_: str) -> None:
    """Leave a trace of one byte."""
    with Path(os.environ[RECORD]).open("ab") as file:
        file.write(b".")


def work(url: str) -> None:
    """Run a worker with two processes."""
    celery_app(url, queue=QUEUE, task_modules=["benchmarks.broker"]).worker_main(worker_arguments(2))


def measure(url: str, messages: int, record: Path) -> None:
    """Print the figures of one broker."""
    app = celery_app(url, queue=QUEUE)
    record.touch()

    begin = time.perf_counter()
    for number in range(messages):
        send(app, TASK, number)
    print(f"publish     {messages / (time.perf_counter() - begin):8.0f} /s")

    program = f"from benchmarks.broker import work; work({url!r})"
    environment = {**os.environ, RECORD: str(record)}
    with subprocess.Popen([sys.executable, "-c", program], env=environment, stdout=subprocess.DEVNULL) as worker:
        wait_for(lambda: record.stat().st_size > 0)
        begin, done = time.perf_counter(), record.stat().st_size
        wait_for(lambda: record.stat().st_size >= messages)
        print(f"drain       {(messages - done) / (time.perf_counter() - begin):8.0f} /s, 2 processes, no-op tasks")

        time.sleep(1)
        before = cpu_s(worker.pid)
        time.sleep(IDLE_S)
        print(f"idle        {100 * (cpu_s(worker.pid) - before) / IDLE_S:8.2f} % of a core")

        delays = [1e3 * probe(app, record) for _ in range(PROBES)]
        print(f"latency     {statistics.mean(delays):8.1f} ms mean, {max(delays):.1f} ms longest of {PROBES}")

        begin = time.perf_counter()
        worker.terminate()
        worker.wait()
        print(f"stop        {time.perf_counter() - begin:8.1f} s")


def probe(app: object, record: Path) -> float:
    """Time from sending a message to the end of its task [s], at a moment unrelated to the broker's rhythm."""
    time.sleep(random.uniform(0.1, 0.2))
    size, begin = record.stat().st_size, time.perf_counter()
    send(app, TASK, 0)
    wait_for(lambda: record.stat().st_size > size)
    return time.perf_counter() - begin


def wait_for(happened: Callable[[], bool]) -> None:
    """Look every half millisecond."""
    while not happened():
        time.sleep(0.0005)


def cpu_s(pid: int) -> float:
    """CPU time of a process so far [s] (Linux)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Entry of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("url", nargs="?")
    parser.add_argument("--messages", type=int, default=10_000)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        measure(options.url or f"embedded://{folder}/broker", options.messages, Path(folder) / "record")


if __name__ == "__main__":
    main()
