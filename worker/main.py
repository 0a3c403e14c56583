"""Process entry of a worker: as many solver processes as cores, each on one thread."""

from __future__ import annotations

import os
import threading

BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

GOODBYE_S = 5.0
"""Longest wait for the last word to the database."""


def main() -> None:
    """Start the worker. On SIGTERM it ends with the jobs at hand, or gives them back when the grace is over."""
    for name in BLAS_THREADS:  # before anything loads a BLAS
        os.environ.setdefault(name, "1")

    import casadi  # noqa: F401 - loaded once here, shared by the children through the fork
    from celery.signals import worker_ready, worker_shutting_down

    from shared.db.revision import require_head
    from shared.dispatch.broker import celery_app, worker_arguments
    from shared.observability import configure_logging
    from shared.settings import Settings
    from worker.drain import begin_drain
    from worker.sign_of_life import keep_saying
    from worker.tasks import MODULE

    settings = Settings()
    configure_logging()
    require_head(settings.database_url)
    worker_shutting_down.connect(lambda **_: begin_drain(settings.drain_s), weak=False)
    app = celery_app(settings.broker_url, task_modules=[MODULE])
    stop = threading.Event()
    sign = threading.Thread(target=keep_saying, args=(settings, stop), name="sign of life", daemon=True)
    worker_ready.connect(lambda **_: sign.start(), weak=False)  # after the pool's processes are forked
    try:
        app.worker_main(worker_arguments(settings.workers, memory_mb=settings.solver_memory_mb))
    finally:
        stop.set()
        if sign.is_alive():
            sign.join(GOODBYE_S)


if __name__ == "__main__":
    main()
