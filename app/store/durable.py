"""Files that are there after a power cut, whole and readable by their owner alone."""

from __future__ import annotations

import os
from pathlib import Path

from app.store.home import refused


def write_durably(path: Path, content: bytes) -> None:
    """Write a file: whoever reads it, now or after a power cut, finds all of it or what was there."""
    temporary = path.with_name(f".{path.name}.partial")
    handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(handle, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(path)
    sync(path.parent)


def make_file(path: Path) -> None:
    """An empty file for its owner alone, where there is none."""
    try:
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT, 0o600))
    except OSError as error:
        raise refused(path, error) from error


def sync(path: Path) -> None:
    """Wait until a file's content, or the names in a folder, are on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
