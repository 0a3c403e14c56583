"""Process entry of a worker: as many solver processes as cores, each on one thread."""

from __future__ import annotations

import os

BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def main() -> None:
    """Start the worker. On SIGTERM it ends with the jobs at hand, or gives them back when the grace is over."""
    for name in BLAS_THREADS:  # before anything loads a BLAS
        os.environ.setdefault(name, "1")

    import casadi  # noqa: F401 - loaded once here, shared by the children through the fork
    from celery.signals import worker_shutting_down

    from shared.dispatch.broker import celery_app, worker_arguments
    from shared.observability import configure_logging
    from shared.settings import Settings
    from worker.drain import begin_drain
    from worker.tasks import MODULE

    settings = Settings()
    configure_logging()
    worker_shutting_down.connect(lambda **_: begin_drain(settings.drain_s), weak=False)
    app = celery_app(settings.broker_url, task_modules=[MODULE])
    app.worker_main(worker_arguments(settings.workers))


if __name__ == "__main__":
    main()
