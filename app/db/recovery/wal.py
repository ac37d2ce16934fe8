"""Write-ahead log: the log beside a database, read from its bytes, before SQLite opens either.

SQLite takes any log that lies beside a database for that database's own: a backup that was copied
over ``touchline.db`` is mixed with the changes of the file that lay there before, page by page,
and is malformed from then on. Nothing in the two files speaks against it. So every write of ours
counts one up in the first page (``user_version``, see ``dialect.sqlite``), which also tells the
installation (``application_id``); and a log belongs to a database exactly when the log's first
change is the one that follows on the database's last.

Source: "Database File Format", https://www.sqlite.org/fileformat2.html, sections 1.3 and 4.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

MAGIC = b"SQLite format 3\0"
_HEADER_BYTES = 100
_LOG_HEADER = struct.Struct(">8I")
_FRAME_HEADER = struct.Struct(">6I")
_BIG_ENDIAN, _LITTLE_ENDIAN = 0x377F0683, 0x377F0682
_NEWEST_LAYOUT = 4
"""Schema format number; SQLite refuses a larger one as if a statement were wrong."""


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
            return _read_transactions(file)
    except FileNotFoundError:
        return WriteAheadLog()


def _is_page_size(value: int) -> bool:
    return 512 <= value <= 65536 and value & (value - 1) == 0


def _read_transactions(file: IO[bytes]) -> WriteAheadLog:
    """Whole transactions, up to the first frame that SQLite would not believe."""
    start = file.read(_LOG_HEADER.size)
    if len(start) < _LOG_HEADER.size:
        return WriteAheadLog()
    magic, _version, page_bytes, _number, *salts, sum_1, sum_2 = _LOG_HEADER.unpack(start)
    if magic not in (_BIG_ENDIAN, _LITTLE_ENDIAN) or not _is_page_size(page_bytes):
        return WriteAheadLog()
    order = ">u4" if magic == _BIG_ENDIAN else "<u4"
    weights, frame_bytes = _fibonacci(page_bytes // 4 + 4), _FRAME_HEADER.size + page_bytes
    sums = _checksum((0, 0), start[:24], order, weights)
    # Of a log whose own sum is wrong no frame is believed.
    is_whole = sums == (sum_1, sum_2)
    commits, headers = 0, []
    pending: DatabaseHeader | None = None
    while is_whole and len(frame := file.read(frame_bytes)) == frame_bytes:
        number, pages, *own_salts, sum_1, sum_2 = _FRAME_HEADER.unpack_from(frame)
        content = frame[_FRAME_HEADER.size :]
        sums = _checksum(sums, frame[:8] + content, order, weights)
        is_whole = own_salts == salts and sums == (sum_1, sum_2)
        if is_whole and number == 1:
            pending = DatabaseHeader.parse(content)
        # The last frame of a transaction says how many pages the database has after it.
        if is_whole and pages:
            commits += 1
            if pending is not None:
                headers.append(pending)
                pending = None
    return WriteAheadLog(commits, page_bytes, tuple(headers))


def _checksum(
    sums: tuple[int, int], data: bytes, order: str, weights: NDArray[np.uint32]
) -> tuple[int, int]:
    """SQLite's running checksum of a log: for each pair (a, b) of words, s += a + t, then t += b + s.

    So each sum is the two before it and one word, modulo 2^32, and each word counts in the last sum as
    often as the Fibonacci number of its distance says. numpy's 32-bit words overflow just so.

    Args:
        sums: Of what came before.
        data: The words, an even number of them.
        order: Their type for numpy.
        weights: At least two Fibonacci numbers more than there are words.
    """
    before = np.array([sums[0], (sums[1] - sums[0]) % 2**32], np.uint32)
    words = np.concatenate([before, np.frombuffer(data, order).astype(np.uint32)])
    return int(weights[1 - len(words) :] @ words[:-1]), int(weights[-len(words) :] @ words)


@cache
def _fibonacci(count: int) -> NDArray[np.uint32]:
    """..., 5, 3, 2, 1, 1 modulo 2^32, so many."""
    numbers = [1, 1]
    while len(numbers) < count:
        numbers.append((numbers[-1] + numbers[-2]) % 2**32)
    return np.array(numbers[::-1], np.uint32)
