"""Quota of uploads: how many bytes the uploads of one person have together, and how many they may have.

Counted is what is kept for them, and what they are sending: a half-sent upload has a record, too, of
its sender and of the bytes that are reserved for it, so that all processes over a home count alike.
"""

from __future__ import annotations

import json
import time
from pathlib import Path

from app.config import Settings
from app.errors import TooLargeError
from app.soccer.actors import person_of_actor

IDLE_SECONDS = 600.0
"""A half-sent upload in which nothing was written for so long has lost its sender."""


def find_person_quota(settings: Settings) -> int | None:
    """How many bytes one person may have; None: nobody counts, as on a server without accounts."""
    return settings.upload_quota_bytes or None if settings.team else None


def count_used_bytes(settings: Settings, actor: str, but: Path | None = None) -> int:
    """How many bytes the uploads of a person have together.

    Args:
        settings: Where they lie.
        actor: The person, or a token of theirs.
        but: A folder that does not count.
    """
    return sum(
        _count_bytes(record, person_of_actor(actor))
        for record in settings.uploads.glob("*/upload.json")
        if record.parent != but
    )


def require_within_quota(settings: Settings, size: int, quota: int, used: int) -> None:
    """Raise TooLargeError where so many more bytes of a person are not allowed."""
    if used + size <= quota:
        return
    raise TooLargeError(
        f"your uploads may have {quota:,} bytes together: {used:,} are used, and this file needs "
        f"{size:,}" + ("" if size <= quota else ", more than all of that"),
        hint="Delete uploads that no dataset reads its frames from (DELETE /api/v1/uploads/ID), wait "
        f"until they expire after {settings.upload_days} days, or ask the operator for more "
        "(TOUCHLINE_UPLOAD_QUOTA_BYTES).",
    )


def _count_bytes(record: Path, person: str) -> int:
    """How many bytes an upload counts for a person; 0: it is not theirs."""
    try:
        values = json.loads(record.read_bytes())
        theirs = any(person_of_actor(actor) == person for actor in values["by"])
        size = int(values.get("size") or values["bytes"])
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return 0
    if not theirs or not record.parent.name.endswith(".part"):
        return size if theirs else 0
    return size if _is_being_written(record.parent) else 0


def _is_being_written(folder: Path) -> bool:
    try:
        newest = max(path.stat().st_mtime for path in (folder, *folder.glob("content/*")))
    except FileNotFoundError:
        return False
    return newest > time.time() - IDLE_SECONDS
