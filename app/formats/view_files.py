"""View files: those of single views of an export, kept together on their way into a zip.

To make a file, and to open it twice more for its checksum and for the zip, takes longer than all
else that an export does for a view.
"""

from __future__ import annotations

import errno
import sqlite3
import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from heapq import merge
from pathlib import Path, PurePosixPath
from typing import Any, TypeAlias

from app.formats.safe_path import require_safe_path, resolve_inside

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


PutText = Callable[[str, str], None]
"""Takes a relative path, and the text of the file there."""
HELD = ".view-files"
"""Where they wait, in the folder in which an export is gathered."""
Gathered: TypeAlias = tuple[str, Path | bytes]
"""A file's relative path; where it lies, or its content."""


def make_disk_writer(root: Path) -> PutText:
    """Writes each file at once below a folder.

    Raises (the result):
        UnsafePathError: A path would leave the folder.
    """

    def put(path: str, text: str) -> None:
        write_file_below(root, path, text)

    return put


def write_file_below(root: Path, path: str, text: str) -> Path:
    """Write a file below a folder, and the folders that it lies in; its path.

    Raises:
        UnsafePathError: The path would leave the folder.
    """
    target = resolve_inside(root, path)
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(text, encoding="utf-8")
    return target


class ViewFileBuffer:
    """Files of a zip, in a database beside its other files; use as a context.

    A file that is put again is the newer one, as on a disk.
    """

    def __init__(self, root: Path):
        self._waiting: list[tuple[str, bytes]] = []
        with translate_disk_errors():
            self._connection = sqlite3.connect(root / HELD, isolation_level=None)
            # Nothing in it outlives the export, so nothing needs to survive a power cut.
            self._connection.execute("PRAGMA journal_mode = OFF")
            self._connection.execute("PRAGMA synchronous = OFF")
            self._connection.execute("CREATE TABLE file (path TEXT PRIMARY KEY, body BLOB)")
            self._connection.execute("BEGIN")

    def __enter__(self) -> ViewFileBuffer:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        with closing(self._connection):
            if kind is None:
                self._flush_to_database()
                with translate_disk_errors():
                    self._connection.execute("COMMIT")

    def write_file(self, path: str, text: str) -> None:
        """Keep a file.

        Raises:
            OSError: The disk refuses, also where the context ends.
            UnsafePathError: The path would leave a folder.
        """
        self._waiting.append((str(PurePosixPath(require_safe_path(path))), text.encode()))
        if len(self._waiting) >= _BATCH:
            self._flush_to_database()

    def _flush_to_database(self) -> None:
        with translate_disk_errors():
            self._connection.executemany("INSERT OR REPLACE INTO file VALUES (?, ?)", self._waiting)
        self._waiting.clear()


class FilesToPack:
    """All files below a folder, those that wait among them, in the order of their paths.

    Raises (each method):
        OSError: The disk refuses.
    """

    def __init__(self, root: Path):
        self._held = root / HELD
        paths = (path for path in root.rglob("*") if path != self._held and path.is_file())
        names: dict[str, Path | bytes] = {path.relative_to(root).as_posix(): path for path in paths}
        self._on_disk = sorted(names.items(), key=_get_file_path)

    def __len__(self) -> int:
        waiting = self._run_query("SELECT count(*) FROM file")
        count: int = sum(number for (number,) in waiting)
        return len(self._on_disk) + count

    def __iter__(self) -> Iterator[Gathered]:
        waiting = self._run_query("SELECT path, body FROM file ORDER BY path")
        return merge(self._on_disk, waiting, key=_get_file_path)

    def _run_query(self, question: str) -> Iterator[Any]:
        if self._held.exists():
            with translate_disk_errors(), closing(sqlite3.connect(self._held)) as connection:
                yield from connection.execute(question)


def _get_file_path(item: Gathered) -> str:
    return item[0]
