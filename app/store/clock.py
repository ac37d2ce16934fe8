"""The time as the store writes it."""

from __future__ import annotations

from datetime import UTC, datetime


def now() -> str:
    """Now in UTC, ISO 8601 with microseconds; the texts sort as the times do."""
    return datetime.now(UTC).isoformat(timespec="microseconds")
