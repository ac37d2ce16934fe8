"""The log: a line for each thing that happened, on stderr, apart from what is printed."""

from __future__ import annotations

import logging
import sys
from collections.abc import Mapping, MutableMapping
from typing import Any, TextIO, cast

import structlog

from app.finite import finite


def log_to_stderr() -> None:
    """Keep what is logged apart from what is printed."""
    structlog.configure(
        processors=[
            structlog.contextvars.merge_contextvars,
            only_finite,
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.format_exc_info,
            structlog.processors.KeyValueRenderer(key_order=["timestamp", "level", "event"]),
        ],
        logger_factory=structlog.WriteLoggerFactory(file=cast(TextIO, _Stderr())),
    )
    logging.basicConfig(stream=sys.stderr, level=logging.WARNING)


def only_finite(_logger: Any, _method: str, event: MutableMapping[str, Any]) -> Mapping[str, Any]:
    """What is logged without numbers that are infinite or NaN."""
    return {name: finite(value) for name, value in event.items()}


class _Stderr:
    """The stderr of the moment: what a logger is given once may be closed later."""

    def write(self, line: str) -> None:
        sys.stderr.write(line)

    def flush(self) -> None:
        sys.stderr.flush()
