"""Cache: versions that were fetched from a server, each once, under its hash."""

from __future__ import annotations

import os
from pathlib import Path


def cache_folder() -> Path:
    """``TOUCHLINE_CACHE``, or ``touchline`` in the user's cache folder."""
    said = os.environ.get("TOUCHLINE_CACHE")
    if said:
        return Path(said)
    root = os.environ.get("XDG_CACHE_HOME")
    return (Path(root) if root else Path.home() / ".cache") / "touchline"


def cached_version(folder: Path, hash_: str, boxes: str, images: bool) -> Path:
    """Where the export of a version is kept.

    Args:
        folder: The cache.
        hash_: Of the version, whole.
        boxes: Which ball box it has.
        images: Whether it has the frames.
    """
    return folder / "versions" / f"{hash_}-{boxes}{'-images' if images else ''}.zip"
