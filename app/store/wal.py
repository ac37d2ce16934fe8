"""The write-ahead log beside a database, read from its bytes, before SQLite opens either.

SQLite takes any log that lies beside a database for that database's own: a backup that was copied
over ``touchline.db`` is mixed with the changes of the file that lay there before, page by page,
and is malformed from then on. Nothing in the two files speaks against it. So every write of ours
counts one up in the first page (``user_version``, see ``store.dialect.sqlite``), which also tells the
installation (``application_id``); and a log belongs to a database exactly when the log's first
change is the one that follows on the database's last.

Source: "Database File Format", https://www.sqlite.org/fileformat2.html, sections 1.3 and 4.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

MAGIC = b"SQLite format 3\0"
_HEADER_BYTES = 100
_LOG_HEADER = struct.Struct(">8I")
_FRAME_HEADER = struct.Struct(">6I")
_BIG_ENDIAN, _LITTLE_ENDIAN = 0x377F0683, 0x377F0682
_NEWEST_LAYOUT = 4
"""Schema format number; SQLite refuses a larger one as if a statement were wrong."""
_CHUNK = 8
"""Bytes that one step of the checksum takes."""


@dataclass(frozen=True)
class DatabaseHeader:
    """The first 100 bytes of a database.

    Attributes:
        raw: The bytes.
        pages: How many pages the database has by its own account.
        page_bytes: Size of each.
        count: Writes that this service has made to it, modulo 2^31; 0 where it never counted.
        tag: The start of the installation's key, as a number; 0 where it has none yet.
    """

    raw: bytes
    pages: int
    page_bytes: int
    count: int
    tag: int

    @staticmethod
    def parse(raw: bytes) -> DatabaseHeader | None:
        """The header of a first page, or None where it is none of a database."""
        if len(raw) < _HEADER_BYTES or not raw.startswith(MAGIC):
            return None
        (size,) = struct.unpack_from(">H", raw, 16)
        (pages,) = struct.unpack_from(">I", raw, 28)
        (count,) = struct.unpack_from(">i", raw, 60)
        (tag,) = struct.unpack_from(">i", raw, 68)
        (layout,) = struct.unpack_from(">I", raw, 44)
        page_bytes = 65536 if size == 1 else size
        if layout > _NEWEST_LAYOUT or not _is_page_size(page_bytes):
            return None
        return DatabaseHeader(raw[:_HEADER_BYTES], pages, page_bytes, count, tag)


@dataclass(frozen=True)
class WriteAheadLog:
    """What a log would bring into its database.

    Attributes:
        commits: Transactions that are whole.
        page_bytes: Size of a page, 0 for a log that is empty.
        headers: The database's header as each of them left it, where it touched it.
    """

    commits: int = 0
    page_bytes: int = 0
    headers: tuple[DatabaseHeader, ...] = ()

    def belongs_to(self, database: DatabaseHeader) -> bool:
        """Whether the log goes on where the database ends.

        The database may have taken over some of the log already: then its header is one of those
        in the log, byte for byte. A log without any header says nothing and is believed.
        """
        if not self.commits:
            return True
        if self.page_bytes != database.page_bytes:
            return False
        if not self.headers or any(header.raw == database.raw for header in self.headers):
            return True
        first = self.headers[0]
        if database.tag not in (first.tag, 0):
            return False
        # Another program that writes to the database counts nothing.
        return database.count in (first.count, (first.count - 1) % 2**31)


def read_header(database: Path) -> DatabaseHeader | None:
    """The header of a database file, or None where it is no database."""
    with database.open("rb") as file:
        return DatabaseHeader.parse(file.read(_HEADER_BYTES))


def read_log(path: Path) -> WriteAheadLog:
    """The log of a path; an empty one where there is none, or nothing whole in it."""
    try:
        with path.open("rb") as file:
            start = file.read(_LOG_HEADER.size)
            if len(start) < _LOG_HEADER.size:
                return WriteAheadLog()
            magic, _version, page_bytes, _number, *_salts = _LOG_HEADER.unpack(start)
            if magic not in (_BIG_ENDIAN, _LITTLE_ENDIAN) or not _is_page_size(page_bytes):
                return WriteAheadLog()
            return _read_frames(file, start, page_bytes)
    except FileNotFoundError:
        return WriteAheadLog()


def _is_page_size(value: int) -> bool:
    return 512 <= value <= 65536 and value & (value - 1) == 0


def _read_frames(file: Any, start: bytes, page_bytes: int) -> WriteAheadLog:
    """Whole transactions, up to the first frame that SQLite would not believe."""
    commits, headers = 0, []
    pending: DatabaseHeader | None = None
    for number, pages, content in _frames(file, start, page_bytes):
        if number == 1:
            pending = DatabaseHeader.parse(content)
        if pages:
            commits += 1
            if pending is not None:
                headers.append(pending)
                pending = None
    return WriteAheadLog(commits, page_bytes, tuple(headers))


def _frames(file: Any, start: bytes, page_bytes: int) -> Iterator[tuple[int, int, bytes]]:
    """Page number, pages of the database after a commit (0 within one), and the page."""
    magic, *_rest, salt_1, salt_2, sum_1, sum_2 = _LOG_HEADER.unpack(start)
    order = ">u4" if magic == _BIG_ENDIAN else "<u4"
    check = _Checksum(order, page_bytes)
    if check.header(start[:24]) != (sum_1, sum_2):
        return
    while len(frame := file.read(_FRAME_HEADER.size + page_bytes)) == check.frame_bytes:
        number, pages, *salts, sum_1, sum_2 = _FRAME_HEADER.unpack_from(frame)
        content = frame[_FRAME_HEADER.size :]
        if salts != [salt_1, salt_2] or check.frame(frame[:8] + content) != (sum_1, sum_2):
            return
        yield number, pages, content


class _Checksum:
    """SQLite's running checksum: for each pair (a, b) of words, s += a + t, then t += b + s.

    That is a linear map, so that a whole frame is one product with weights made beforehand; all
    modulo 2^32, which is how numpy's 32-bit words overflow.
    """

    def __init__(self, order: str, page_bytes: int):
        self._order = order
        self.frame_bytes = _FRAME_HEADER.size + page_bytes
        self._state = (0, 0)
        self._weights = _weights((8 + page_bytes) // _CHUNK)

    def header(self, data: bytes) -> tuple[int, int]:
        """After the 24 bytes of the log's own header."""
        self._state = self._after(data, _weights(len(data) // _CHUNK))
        return self._state

    def frame(self, data: bytes) -> tuple[int, int]:
        """After a frame: the first 8 bytes of its header, and its page."""
        self._state = self._after(data, self._weights)
        return self._state

    def _after(self, data: bytes, weights: Any) -> tuple[int, int]:
        words = np.frombuffer(data, self._order).astype(np.uint32).reshape(-1, 2)
        first, second = words[:, 0], words[:, 0] + words[:, 1]
        start = [np.uint32(value) for value in self._state]
        sums = []
        for row in weights:
            total = np.sum(row[1:, 0] * first + row[1:, 1] * second, dtype=np.uint32)
            with np.errstate(over="ignore"):
                sums.append(int(row[0, 0] * start[0] + row[0, 1] * start[1] + total))
        return sums[0], sums[1]


def _weights(steps: int) -> Any:
    """Powers of ((1, 1), (1, 2)) modulo 2^32 from ``steps`` down to 0, by row, (2, steps + 1, 2)."""
    matrices = [(1, 0, 0, 1)]
    for _ in range(steps):
        a, b, c, d = matrices[-1]
        matrices.append(
            ((a + c) % 2**32, (b + d) % 2**32, (a + 2 * c) % 2**32, (b + 2 * d) % 2**32)
        )
    return np.array(matrices[::-1], np.uint32).reshape(-1, 2, 2).transpose(1, 0, 2)
