"""Plain files: opened only where they are files; a pipe would wait for who writes into it."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import IO

from app.errors import DatasetFormatError

MAX_BYTES = 256 * 1024 * 1024
"""Longest file that is read whole."""


def open_regular_file(path: Path, shown: str = "") -> IO[bytes]:
    """A file open for reading.

    Args:
        path: The file.
        shown: Its name as a person knows it; empty: the path.

    Raises:
        DatasetFormatError: It is a pipe, a device, a socket or a folder.
        OSError: It cannot be opened.
    """
    file = open(path, "rb", opener=_open_without_blocking)  # noqa: SIM115 - who asked closes it
    if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        return file
    file.close()
    raise DatasetFormatError(shown or str(path), None, None, "is not a plain file")


def _open_without_blocking(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK)


def read_regular_file(path: Path, limit: int = MAX_BYTES) -> bytes:
    """The whole content of a file that somebody named.

    Raises:
        DatasetFormatError: It cannot be read, is no plain file, or is longer than the limit.
    """
    try:
        with open_regular_file(path) as file:
            content = file.read(limit + 1)
    except OSError as error:
        problem = f"cannot be read ({error.strerror})"
        raise DatasetFormatError(str(path), None, None, problem) from error
    if len(content) > limit:
        raise DatasetFormatError(str(path), None, None, f"is longer than {limit:,} bytes")
    return content
