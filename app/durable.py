"""Durable: files that are there after a power cut, under their name, whole or not at all."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

PARTIAL = ".partial"
"""How the name of what is not complete yet ends; it begins with a dot."""


def sync(path: Path) -> None:
    """Put a file, or the names in a folder, on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def replace_file(path: Path, content: bytes | memoryview, *, durable: bool = True) -> None:
    """Write a file for its owner alone: a reader sees all of it or what was there before.

    Of several writers the last one stays.

    Args:
        path: The file.
        content: All of it.
        durable: Whether that holds after a power cut, too; it costs a wait for the disk.
    """
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=PARTIAL, dir=path.parent)
    partial = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            if durable:
                os.fsync(file.fileno())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
    if durable:
        sync(path.parent)
