"""Pre-open check: a home's files, before SQLite opens the database and repairs what it should not.

What is refused here stays as it is: SQLite would take an empty file for a new database, and any log
beside it for its own; and whoever closes a database last writes the log into it and deletes it, also
where its end is damaged.
"""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from urllib.parse import quote

import pysqlite3.dbapi2

from app.config import Settings
from app.db.dialects.dialect import make_engine, report_storage_errors
from app.db.home import ASIDE, KEYS
from app.db.recovery.anchor import read_anchor, require_own_database
from app.db.recovery.wal import DatabaseHeader, WriteAheadLog, read_header, read_log
from app.errors import DamagedError, StorageError

VERSION_TABLE = "alembic_version"
"""Every database of ours has it."""


def log_file(database: Path) -> Path:
    """The write-ahead log beside a database."""
    return database.with_name(f"{database.name}-wal")


def require_sound(settings: Settings) -> None:
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
        log = read_log(log_file(database))
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
    _require_whole(database, header, log)
    if read_anchor(database) is None:
        _require_no_foreign_tables(database)
    if _file_size(log_file(database)):
        _require_log_end_of_anchor(settings)


def _require_whole(database: Path, header: DatabaseHeader, log: WriteAheadLog) -> None:
    if not log.belongs_to(header):
        raise DamagedError(
            f"{log_file(database)} is the write-ahead log of another database than {database}:"
            " together they would destroy each other",
            hint="If a backup was copied here, run touchline restore with it; "
            f"touchline restore {database} goes on without the log. Both keep all files.",
        )
    size, expected = _file_size(database), header.pages * header.page_bytes
    if not log.commits and size < expected:
        raise DamagedError(
            f"{database} is cut short: {size:,} of {expected:,} bytes are there",
            hint="Run touchline restore BACKUP with your newest backup; the damaged file is kept"
            " under another name.",
        )


def _require_log_end_of_anchor(settings: Settings) -> None:
    """Raise DamagedError where database and log together are not what the home knows.

    A connection that only reads leaves both as they are when it is closed.
    """
    # Once for SQLAlchemy, which reads a URL, and once for SQLite, which is handed one.
    file = quote(quote(str(settings.database_file)))
    url = f"sqlite+pysqlite:///file:{file}?mode=ro&uri=true"
    engine = make_engine(settings.model_copy(update={"database_url": url}))
    try:
        with report_storage_errors(settings):
            require_own_database(engine, settings)
    finally:
        engine.dispose()


def _require_no_foreign_tables(database: Path) -> None:
    """Raise StorageError where a file that would get our tables has those of another program."""
    # Where its log is empty, SQLite need not make files for it either.
    alone = "" if _file_size(log_file(database)) else "&immutable=1"
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
    if signs := signs_of_use(settings):
        state = "is empty" if database.exists() else "is missing"
        raise DamagedError(
            f"{database} {state}, but this home has been used: {', '.join(signs)}",
            hint="Run touchline restore BACKUP. To begin anew, set TOUCHLINE_HOME to another"
            " folder, or move this one away.",
        )


def signs_of_use(settings: Settings) -> list[str]:
    """What a home without a database holds that only a database explains."""
    database = settings.database_file
    anchor = read_anchor(database)
    log = log_file(database)
    aside = next(settings.home.glob(f"{ASIDE}*/{database.name}"), None)
    signs = [
        None if anchor is None else f"home.json knows {anchor.entries:,} entries of its log",
        f"{log.name} holds changes" if _file_size(log) else None,
        _count_files_sentence(settings.uploads, "*/upload.json"),
        _count_files_sentence(settings.exports, "*.json"),
        _count_files_sentence(settings.home / "backups", "*.zip"),
        *(_count_files_sentence(settings.home / name, "*") for name in ("sample", "practice")),
        *(f"{name} is there" for name in KEYS if (settings.home / name).exists()),
        None if aside is None else f"{aside.parent.name}/ holds its database",
    ]
    return [sign for sign in signs if sign is not None]


def _count_files_sentence(folder: Path, pattern: str) -> str | None:
    count = sum(1 for _ in folder.glob(pattern))
    return f"{folder.name}/ holds {count:,}" if count else None


def _file_size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


MOVED = (
    "Stop the server and put the file that was moved back into its place: with the -wal that lies there"
    " it has the newest changes. Where it was deleted, restore the newest backup."
)
LOG_MOVED = "Stop the server before anything else opens the database: what was saved goes into its file then."


class OpenedFile:
    """The file of a database that is open from now on."""

    def __init__(self, database: Path):
        self._database, self._log = database, log_file(database)
        self._opened = _file_identity(database)

    def require_there(self) -> None:
        """Raise DamagedError where another file lies in the database's place, or none."""
        found = _file_identity(self._database)
        if found is None:
            raise DamagedError(
                f"{self._database.name} was moved or deleted while it was open", hint=MOVED
            )
        if found != self._opened:
            raise DamagedError(
                f"{self._database.name} was replaced by another file while it was open", hint=MOVED
            )

    def require_log(self) -> None:
        """Raise DamagedError where the write-ahead log is gone.

        For who is in a transaction: SQLite deletes it when nobody has the database open any more.
        """
        if not self._log.exists():
            raise DamagedError(
                f"{self._log.name} was moved or deleted while the database was open", hint=LOG_MOVED
            )


def _file_identity(file: Path) -> tuple[int, int] | None:
    """What tells a file from all others at its place; None where there is none to be seen."""
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino
