"""Pre-open check: a home's files and the write-ahead log beside its database, read before SQLite opens and repairs them.

What is refused here stays as it is: SQLite would take an empty file for a new database, and any log
beside it for its own; and whoever closes a database last writes the log into it and deletes it, also
where its end is damaged.

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
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import IO
from urllib.parse import quote

import numpy as np
import pysqlite3.dbapi2
from numpy.typing import NDArray

from app.config import Settings
from app.db.dialects.dialect import make_engine, translate_storage_errors
from app.db.home import ASIDE, KEYS
from app.db.recovery.anchor import read_anchor, require_own_database
from app.errors import DamagedError, InputError, StorageError

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


def summarize_wal_file(path: Path) -> WriteAheadLog:
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
    weights, frame_bytes = (
        _list_fibonacci_numbers(page_bytes // 4 + 4),
        _FRAME_HEADER.size + page_bytes,
    )
    sums = _update_checksum((0, 0), start[:24], order, weights)
    # Of a log whose own sum is wrong no frame is believed.
    is_whole = sums == (sum_1, sum_2)
    commits, headers = 0, []
    pending: DatabaseHeader | None = None
    while is_whole and len(frame := file.read(frame_bytes)) == frame_bytes:
        number, pages, *own_salts, sum_1, sum_2 = _FRAME_HEADER.unpack_from(frame)
        content = frame[_FRAME_HEADER.size :]
        sums = _update_checksum(sums, frame[:8] + content, order, weights)
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


def _update_checksum(
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
def _list_fibonacci_numbers(count: int) -> NDArray[np.uint32]:
    """..., 5, 3, 2, 1, 1 modulo 2^32, so many."""
    numbers = [1, 1]
    while len(numbers) < count:
        numbers.append((numbers[-1] + numbers[-2]) % 2**32)
    return np.array(numbers[::-1], np.uint32)


VERSION_TABLE = "alembic_version"
"""Every database of ours has it."""


def find_write_ahead_log_file(database: Path) -> Path:
    """The write-ahead log beside a database."""
    return database.with_name(f"{database.name}-wal")


def require_consistent_home_files(settings: Settings) -> None:
    """Raise where the files of a home do not belong together.

    Nobody may have the database open meanwhile: both files change under a writer.

    Raises:
        DamagedError: The database is gone, emptied, cut short, no database, lies beside the log of
            another one, or holds less with its own than was said.
        StorageError: A file cannot be read, or is the database of another program.
    """
    database = settings.database_file
    try:
        if not _file_size(database):
            _require_unused_home(settings)
            return
        header = read_header(database)
        log = summarize_wal_file(find_write_ahead_log_file(database))
    except OSError as error:
        raise StorageError(
            f"{error.filename or database} cannot be read ({error.strerror})",
            hint="Make the home folder and its files readable and writable for this user.",
        ) from error
    if header is None:
        raise DamagedError(
            f"{database} is damaged or not a database",
            hint="Run touchline restore BACKUP with your newest backup; the damaged file is kept"
            " under another name.",
        )
    _require_complete_database(database, header, log)
    if read_anchor(database) is None:
        _require_no_foreign_tables(database)
    if _file_size(find_write_ahead_log_file(database)):
        _require_log_reaches_anchor(settings)


def _require_complete_database(database: Path, header: DatabaseHeader, log: WriteAheadLog) -> None:
    if not log.belongs_to(header):
        raise DamagedError(
            f"{find_write_ahead_log_file(database)} is the write-ahead log of another database, not of"
            f" {database}: opening them together would damage the data",
            hint="If you copied a backup into this folder, run touchline restore with that backup"
            f" instead. touchline restore {database} opens the database without the log. Both"
            " commands keep all files.",
        )
    size, expected = _file_size(database), header.pages * header.page_bytes
    if not log.commits and size < expected:
        raise DamagedError(
            f"{database} is truncated: it has {size:,} of {expected:,} bytes",
            hint="Run touchline restore BACKUP with your newest backup; the damaged file is kept"
            " under another name.",
        )


def _require_log_reaches_anchor(settings: Settings) -> None:
    """Raise DamagedError where database and log together are not what the home knows.

    A connection that only reads leaves both as they are when it is closed.
    """
    # Once for SQLAlchemy, which reads a URL, and once for SQLite, which is handed one.
    file = quote(quote(str(settings.database_file)))
    url = f"sqlite+pysqlite:///file:{file}?mode=ro&uri=true"
    engine = make_engine(settings.model_copy(update={"database_url": url}))
    try:
        with translate_storage_errors(settings):
            require_own_database(engine, settings)
    finally:
        engine.dispose()


def _require_no_foreign_tables(database: Path) -> None:
    """Raise StorageError where a file that would get our tables has those of another program."""
    # Where its log is empty, SQLite need not make files for it either.
    alone = "" if _file_size(find_write_ahead_log_file(database)) else "&immutable=1"
    file = f"file:{quote(str(database))}?mode=ro{alone}"
    question = "SELECT name FROM sqlite_schema WHERE type = 'table' ORDER BY name"
    try:
        with closing(pysqlite3.dbapi2.connect(file, uri=True)) as connection:
            tables = [name for (name,) in connection.execute(question)]
    except pysqlite3.dbapi2.Error:
        # Whoever opens it says what is the matter with it.
        return
    if tables and VERSION_TABLE not in tables:
        named = ", ".join(tables[:3]) + (", ..." if len(tables) > 3 else "")
        raise StorageError(
            f"{database} is the database of another program (tables: {named})",
            hint="Nothing in it was changed. Move it away, or name another file in TOUCHLINE_DATABASE_URL.",
        )


def _require_unused_home(settings: Settings) -> None:
    """Raise DamagedError where a home without a database has had one."""
    database = settings.database_file
    if signs := list_signs_of_use(settings):
        state = "is empty" if database.exists() else "is missing"
        raise DamagedError(
            f"{database} {state}, but this home has been used: {', '.join(signs)}",
            hint="Run touchline restore BACKUP. To begin anew, set TOUCHLINE_HOME to another"
            " folder, or move this one away.",
        )


def require_database(settings: Settings, hint: str) -> None:
    """Raise InputError unless a home has a database, or signs that it had one; makes nothing."""
    if not settings.database_file.exists() and not list_signs_of_use(settings):
        raise InputError(f"there is no database in {settings.home}", hint=hint)


def list_signs_of_use(settings: Settings) -> list[str]:
    """What a home without a database holds that only a database explains."""
    database = settings.database_file
    anchor = read_anchor(database)
    log = find_write_ahead_log_file(database)
    aside = next(settings.home.glob(f"{ASIDE}*/{database.name}"), None)
    signs = [
        None if anchor is None else f"home.json knows {anchor.entries:,} entries of its log",
        f"{log.name} holds changes" if _file_size(log) else None,
        _describe_file_count(settings.uploads, "*/upload.json"),
        _describe_file_count(settings.exports, "*.json"),
        _describe_file_count(settings.home / "backups", "*.zip"),
        *(_describe_file_count(settings.home / name, "*") for name in ("sample", "practice")),
        *(f"{name} is there" for name in KEYS if (settings.home / name).exists()),
        None if aside is None else f"{aside.parent.name}/ holds its database",
    ]
    return [sign for sign in signs if sign is not None]


def _describe_file_count(folder: Path, pattern: str) -> str | None:
    count = sum(1 for _ in folder.glob(pattern))
    return f"{folder.name}/ holds {count:,}" if count else None


def _file_size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


MOVED = (
    "Stop the server and move the database file back to its place: with the -wal file there"
    " it has the newest changes. If the file was deleted, restore the newest backup."
)
LOG_MOVED = "Stop the server before another program opens the database: the server then writes its changes into the file."


class OpenDatabaseFile:
    """The file of a database that is open from now on."""

    def __init__(self, database: Path):
        self._database, self._log = database, find_write_ahead_log_file(database)
        self._opened = _read_file_identity(database)

    def require_same_file(self) -> None:
        """Raise DamagedError where another file lies in the database's place, or none."""
        found = _read_file_identity(self._database)
        if found is None:
            raise DamagedError(
                f"{self._database.name} was moved or deleted while it was open", hint=MOVED
            )
        if found != self._opened:
            raise DamagedError(
                f"{self._database.name} was replaced by another file while it was open", hint=MOVED
            )

    def require_write_ahead_log(self) -> None:
        """Raise DamagedError where the write-ahead log is gone.

        For who is in a transaction: SQLite deletes it when nobody has the database open any more.
        """
        if not self._log.exists():
            raise DamagedError(
                f"{self._log.name} was moved or deleted while the database was open", hint=LOG_MOVED
            )


def _read_file_identity(file: Path) -> tuple[int, int] | None:
    """What tells a file from all others at its place; None where there is none to be seen."""
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino
