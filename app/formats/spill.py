"""Spill: items on disk that come back in the order of their keys, however many there are."""

from __future__ import annotations

import errno
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

Key = tuple[int, int, str, int]
"""Compared from left to right; what they stand for is the caller's matter."""
_BATCH = 1000


class SortedSpill:
    """Takes items in any order."""

    def __init__(self, connection: sqlite3.Connection):
        self._connection = connection
        self._waiting: list[tuple[int, int, str, int, str]] = []
        connection.execute("CREATE TABLE item (a INT, b INT, c TEXT, d INT, body TEXT)")

    def add(self, key: Key, body: str) -> None:
        """Keep an item; equal keys keep the order in which they came."""
        self._waiting.append((*key, body))
        if len(self._waiting) >= _BATCH:
            self._flush_to_disk()

    def items(self) -> Iterator[tuple[Key, str]]:
        """Everything, by key."""
        self._flush_to_disk()
        rows = self._connection.execute("SELECT * FROM item ORDER BY a, b, c, d, rowid")
        for a, b, c, d, body in rows:
            yield (a, b, c, d), body

    def _flush_to_disk(self) -> None:
        with translate_disk_errors():
            self._connection.executemany("INSERT INTO item VALUES (?, ?, ?, ?, ?)", self._waiting)
        self._waiting.clear()


@contextmanager
def translate_disk_errors() -> Iterator[None]:
    """For a database in the place of files: what the disk refuses is told as it is of a file.

    Raises:
        OSError: The database could not be written or read.
    """
    try:
        yield
    except sqlite3.OperationalError as error:
        raise OSError(errno.EIO, str(error)) from error


@contextmanager
def open_spill() -> Iterator[SortedSpill]:
    """A spill in a temporary file, which goes when the block ends."""
    with tempfile.TemporaryDirectory(prefix="touchline-") as folder:
        path = Path(folder) / "spill.db"
        with closing(sqlite3.connect(path, isolation_level=None)) as connection:
            # Nothing in it outlives the block, so nothing needs to survive a power cut.
            connection.execute("PRAGMA journal_mode = OFF")
            connection.execute("PRAGMA synchronous = OFF")
            connection.execute("BEGIN")
            yield SortedSpill(connection)
