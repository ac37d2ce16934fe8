"""The log: a line for each thing that happened, on stderr, apart from what is printed."""

from __future__ import annotations

import logging
import sys
from collections.abc import Mapping, MutableMapping
from typing import Any, Literal, TextIO, cast

import structlog

from app.json_text import replace_non_finite

LogFormat = Literal["text", "json"]


def log_to_stderr(form: LogFormat = "text") -> None:
    """Keep what is logged apart from what is printed.

    Args:
        form: ``text``: a line of ``name=value`` for each event; ``json``: a JSON object a line, also
            for what libraries log.
    """
    before: list[Any] = [
        structlog.contextvars.merge_contextvars,
        replace_non_finite_numbers,
        structlog.processors.add_log_level,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
        structlog.processors.format_exc_info,
    ]
    order = structlog.processors.KeyValueRenderer(key_order=["timestamp", "level", "event"])
    render = structlog.processors.JSONRenderer(default=str) if form == "json" else order
    structlog.configure(
        processors=[*before, render],
        logger_factory=structlog.WriteLoggerFactory(file=cast(TextIO, _CurrentStderr())),
    )
    handler = logging.StreamHandler(sys.stderr)
    if form == "json":
        # The logger of a library is its own field, and its line is one line, with a traceback, too.
        named = structlog.stdlib.add_logger_name
        last = structlog.stdlib.ProcessorFormatter.remove_processors_meta
        handler.setFormatter(
            structlog.stdlib.ProcessorFormatter(
                foreign_pre_chain=[named, *before], processors=[last, render]
            )
        )
    logging.captureWarnings(True)
    logging.basicConfig(handlers=[handler], level=logging.WARNING, force=form == "json")


def replace_non_finite_numbers(
    _logger: Any, _method: str, event: MutableMapping[str, Any]
) -> Mapping[str, Any]:
    """What is logged without numbers that are infinite or NaN."""
    return {name: replace_non_finite(value) for name, value in event.items()}


class _CurrentStderr:
    """The stderr of the moment: what a logger is given once may be closed later."""

    def write(self, line: str) -> None:
        sys.stderr.write(line)

    def flush(self) -> None:
        sys.stderr.flush()
