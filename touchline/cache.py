"""Cache: versions that were fetched from a server, each once."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def cache_folder() -> Path:
    """``TOUCHLINE_CACHE``, or ``touchline`` in the user's cache folder."""
    said = os.environ.get("TOUCHLINE_CACHE")
    if said:
        return Path(said)
    root = os.environ.get("XDG_CACHE_HOME")
    return (Path(root) if root else Path.home() / ".cache") / "touchline"


def cached_version(folder: Path, version: Mapping[str, Any], boxes: str, images: bool) -> Path:
    """Where the export of a version is kept.

    Versions with the same content have one hash, and may differ in name, licence and pictures.

    Args:
        folder: The cache.
        version: As the server describes it.
        boxes: Which ball box it has.
        images: Whether it has the frames.
    """
    told = repr([version[name] for name in ("dataset", "name", "created")])
    which = hashlib.sha256(told.encode()).hexdigest()[:12]
    return (
        folder / "versions" / f"{version['hash']}-{which}-{boxes}{'-images' if images else ''}.zip"
    )
