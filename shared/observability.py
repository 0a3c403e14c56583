"""Structured logs, one JSON object a line on standard error, with ids bound where they are known."""

from __future__ import annotations

import logging
import os
import sys

import structlog


def configure_logging() -> None:
    """Set up structlog and the standard library's loggers; level from ARMATURE_LOG_LEVEL (default INFO)."""
    level = getattr(logging, os.environ.get("ARMATURE_LOG_LEVEL", "INFO").upper(), logging.INFO)
    logging.basicConfig(level=level, stream=sys.stderr, format="%(message)s", force=True)
    structlog.configure(
        processors=[
            structlog.contextvars.merge_contextvars,
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.format_exc_info,
            structlog.processors.JSONRenderer(),
        ],
        wrapper_class=structlog.make_filtering_bound_logger(level),
        logger_factory=structlog.PrintLoggerFactory(sys.stderr),
    )
