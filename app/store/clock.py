"""The time as the store writes it."""

from __future__ import annotations

from datetime import UTC, datetime


def now() -> str:
    """Now, as ``text_of`` writes it."""
    return text_of(datetime.now(UTC))


def text_of(at: datetime) -> str:
    """A time with a zone in UTC, ISO 8601 with microseconds; the texts sort as the times do."""
    return at.astimezone(UTC).isoformat(timespec="microseconds")
