"""Structured logs: one JSON object a line on standard error, with the ids of what a line is about."""

from __future__ import annotations

import logging
import os
import sys

import structlog

PROCESSORS: list[structlog.typing.Processor] = [
    structlog.contextvars.merge_contextvars,
    structlog.processors.add_log_level,
    structlog.processors.TimeStamper(fmt="iso", utc=True),
    structlog.processors.format_exc_info,
]
"""What every line gets, whoever wrote it. Ids are context variables: `request`, `application`, `job`."""


def configure_logging() -> None:
    """Set up structlog and the standard library's loggers; level from ARMATURE_LOG_LEVEL (default INFO)."""
    level = getattr(logging, os.environ.get("ARMATURE_LOG_LEVEL", "INFO").upper(), logging.INFO)
    logging.basicConfig(level=level, handlers=[_of_libraries()], force=True)
    structlog.configure(
        processors=[*PROCESSORS, structlog.processors.JSONRenderer()],
        wrapper_class=structlog.make_filtering_bound_logger(level),
        logger_factory=structlog.PrintLoggerFactory(sys.stderr),
    )


def _of_libraries() -> logging.Handler:
    """Lines of Celery, uvicorn and others, which use the standard library, in the same form."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=[structlog.stdlib.add_logger_name, structlog.stdlib.ExtraAdder(), *PROCESSORS],
            processors=[
                structlog.stdlib.ProcessorFormatter.remove_processors_meta,
                structlog.processors.JSONRenderer(default=str),
            ],
        )
    )
    return handler
