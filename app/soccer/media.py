"""Media: where the picture of a view lies."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Media:
    """Where the frame of a view can be read: a file, or a member of an archive."""

    path: str
    member: str | None = None
    frame: int | None = None
    """Number of the frame when ``path`` is a video."""
