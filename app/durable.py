"""Durable: files that are there after a power cut, under their name, whole or not at all."""

from __future__ import annotations

import os
import secrets
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


def replace_file(
    path: Path, content: bytes | memoryview, *, durable: bool = True, private: bool = True
) -> None:
    """Write a file: a reader sees all of it or what was there before.

    Of several writers the last one stays.

    Args:
        path: The file.
        content: All of it.
        durable: Whether that holds after a power cut, too; it costs a wait for the disk.
        private: Whether it is for its owner alone; otherwise the umask decides.
    """
    partial = path.with_name(f".{path.name}.{secrets.token_hex(4)}{PARTIAL}")
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
    handle = os.open(partial, flags, 0o600 if private else 0o666)
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
