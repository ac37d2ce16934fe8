"""Store: the database of a home, its reads and its writes."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import replace

import structlog
from sqlalchemy import Engine, update
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as NoConnectionError

from app.config import Settings
from app.db.dialects.dialect import (
    ALL_CHANGED,
    WRITE,
    get_dialect,
    make_engine,
    translate_storage_errors,
)
from app.db.home import create_private_file
from app.db.home_paths import set_home_of_engine
from app.db.locks import DatabaseOpenLock
from app.db.migrate import (
    KNOWN_REVISIONS,
    SCHEMA_REVISION,
    migrate_database_under_lock,
    newer_schema_error,
    read_schema_revision,
)
from app.db.recovery.anchor import (
    DatabaseAnchor,
    flush_anchor_to_disk,
    overwrite_anchor,
    read_anchor,
    renew_anchor,
    require_own_database,
)
from app.db.recovery.preopen_check import OpenDatabaseFile, require_consistent_home_files
from app.db.session import InstallationModel, Session
from app.errors import EXAMINE, BusyError, DamagedError, StorageError

log = structlog.get_logger("touchline.store")

_UNCHANGED = update(InstallationModel).values(created=InstallationModel.created)
"""Writes a row as it is."""
COMMITTED = "committed"
"""What other processes are told of a commit."""
TURN_SECONDS = 10.0
"""How long a thread waits for the writes of others in its process; SQLite waits for other
processes (``busy_timeout``)."""


class ThreadWriteLock:
    """The turn to write among the threads of one process.

    Raises:
        StorageError: Others were writing all the while.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()

    def __enter__(self) -> None:
        if not self._lock.acquire(timeout=TURN_SECONDS):
            raise StorageError(
                "other changes are still being written; this one was not saved",
                hint="Try again in a moment.",
            )

    def __exit__(self, *_: object) -> None:
        self._lock.release()


class Store:
    """The database of one home: short read transactions, and one write at a time.

    Use ``Store.open``; the constructor trusts its engine.

    Attributes:
        turn: Held while something is written; writers of one process wait for it.
        sharing: What processes with the same database leave to one of them, and tell each other.
    """

    def __init__(
        self,
        engine: Engine,
        settings: Settings,
        lock: DatabaseOpenLock,
        turn: AbstractContextManager[object],
    ):
        self.settings = settings
        self._engine = engine
        self._reader = get_dialect(settings).reading(engine)
        self._writer = engine.execution_options(**WRITE)
        self._glancer = get_dialect(settings).autocommit_engine(engine)
        self._peeker = get_dialect(settings).nonblocking_engine(settings)
        # Connections of its own: one that waits for no disk must never carry what was promised.
        self._passing = make_engine(settings, lasting=False).execution_options(**WRITE)
        self.sharing = get_dialect(settings).sharing(
            engine, lambda: translate_storage_errors(settings)
        )
        for each in (engine, self._peeker, self._passing):
            if each is not None:
                set_home_of_engine(each, settings)
        self._lock = lock
        self.turn = turn
        self._listeners: list[Callable[[], None]] = []
        self._anchor = read_anchor(settings.database_file)
        self._anchor_refused = False
        file = settings.database_file
        self._file = OpenDatabaseFile(file) if get_dialect(settings).is_file else None
        self._damage: tuple[str, str] | None = None
        self._refused: StorageError | None = None

    @staticmethod
    def open(settings: Settings, turn: AbstractContextManager[object] | None = None) -> Store:
        """Open the database; an empty home is migrated, an older one must be first.

        Args:
            settings: Where it lies.
            turn: The turn to write, where it is shared with another process.

        Raises:
            StorageError: The schema is older or newer than this version's, or SQLite does not keep
                the promises asked of it.
            DamagedError: The database is not what was written, or not the one of its home.
            InputError: The URL is neither one of SQLite nor of PostgreSQL.
        """
        lock = DatabaseOpenLock(settings)
        engine: Engine | None = None
        try:
            engine = _open_engine(settings, lock.alone)
            lock.share()
            return Store(engine, settings, lock, ThreadWriteLock() if turn is None else turn)
        except BaseException:
            if engine is not None:
                engine.dispose()
            lock.release()
            raise

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A session on one consistent snapshot; nothing that it changes is kept."""
        with self._note_raised_damage(), Session(self._reader) as session:
            yield session

    @contextmanager
    def read_for_one_statement(self) -> Iterator[Session]:
        """A session for one statement, which is a snapshot by itself and needs no transaction.

        For what every request asks.
        """
        with self._note_raised_damage(), Session(self._glancer) as session:
            yield session

    @contextmanager
    def read_without_waiting(self) -> Iterator[Session]:
        """A session like that of ``read_for_one_statement`` for whoever may wait for nothing, as the event loop.

        Raises:
            BusyError: There would be something to wait for; ``read_for_one_statement`` waits for it.
        """
        if self._peeker is None:
            raise BusyError("the database cannot be read now without waiting for another process")
        try:
            with self._note_raised_damage(), Session(self._peeker) as session:
                yield session
        except NoConnectionError as error:
            raise BusyError(
                "another thread is using the connection for reads that must not wait"
            ) from error

    @contextmanager
    def write(self, *, lasting: bool = True) -> Iterator[Session]:
        """A session that holds the database's write lock from its start and commits at its end.

        Threads of one process wait for their turn here, processes in SQLite. It does not nest.

        Args:
            lasting: False: nobody waits until it is on the disk, and a power cut may take it back,
                as a whole. For what nobody would miss; the log is not written so.

        Raises:
            StorageError: Others were writing all the while; nothing was changed.
        """
        self.require_undamaged()
        writer = self._writer if lasting else self._passing
        with (
            self.turn,
            self._remember_write_failure(),
            self._note_raised_damage(),
            Session(writer) as session,
        ):
            # Take the lock before anything is read, so that what is read is still true when it
            # is written.
            session.begin()
            yield session
            session.store_response()
            if not lasting and session.log_end is not None:
                raise RuntimeError(
                    "a write with log entries must be durable: call write() without lasting=False"
                )
            self._require_untruncated_log(session)
            if self._file is not None:
                self._file.require_same_file()
                self._file.require_write_ahead_log()
            if lasting:
                self.sharing.publish(session, COMMITTED)
            with translate_storage_errors(self.settings, committing=True):
                session.commit()
            self._refused = None
            self._save_anchor(session)
        self.notify_listeners()

    def require_writable(self) -> None:
        """Raise StorageError while changes are refused, as on a full disk.

        Once one was refused, a row is written as it is to know whether the next one would be.
        """
        if self._refused is not None:
            with self.write(lasting=False) as session:
                session.execute(_UNCHANGED)

    @contextmanager
    def _remember_write_failure(self) -> Iterator[None]:
        """Note what keeps the database from being written."""
        try:
            yield
        except (BusyError, DamagedError):
            raise
        except StorageError as error:
            if isinstance(error.__cause__, DBAPIError):
                self._refused = error
            raise

    def notify_listeners(self) -> None:
        """Call all who listen: this process has committed, or another one that works for it."""
        for listener in self._listeners:
            try:
                listener()
            except Exception:
                log.exception("a change was saved, but a listener could not be notified")

    @property
    def is_damaged(self) -> bool:
        """Whether the database was seen to be damaged."""
        return self._damage is not None

    def require_undamaged(self) -> None:
        """Raise DamagedError once the database was seen to be damaged, or its file is another.

        What is left of it is read as long as it can be; another change could only spoil more.
        """
        if self._damage is not None:
            message, hint = self._damage
            raise DamagedError(f"nothing can be changed now: {message}", hint=hint)
        if self._file is not None:
            with self._note_raised_damage():
                self._file.require_same_file()

    def require_intact_database(self, wanted: Callable[[], bool] = lambda: True) -> None:
        """Let SQLite look at every page and index; raise DamagedError where it finds a fault.

        It ends early, without a word, once it is no longer ``wanted``.
        """
        dialect = get_dialect(self.settings)
        with self.read() as session, dialect.interrupt_when(session, lambda: not wanted()):
            faults = dialect.find_file_faults(session, 1)
            if faults:
                file = self.settings.database_file
                log.error("the database is damaged", file=str(file), fault=faults[0])
                raise DamagedError(f"{file.name} is damaged", hint=EXAMINE)

    @contextmanager
    def _note_raised_damage(self) -> Iterator[None]:
        try:
            with translate_storage_errors(self.settings):
                yield
        except DamagedError as error:
            self.record_damage(error)
            raise

    def record_damage(self, error: DamagedError) -> None:
        """Refuse writes from now on, because stored data is damaged. The first error stays the reason."""
        self._damage = self._damage or (error.message, error.hint or EXAMINE)

    def _require_untruncated_log(self, session: Session) -> None:
        """Raise DamagedError where the log had ended before what was said already.

        It only ever grows, whoever writes: not even an anchor that another process moved is ahead.
        """
        if session.log_end is None or self._anchor is None:
            return
        there: DatabaseAnchor | None = self._anchor
        with suppress(OSError, DamagedError):
            there = read_anchor(self.settings.database_file)
        # One that was taken away is meant to be.
        if there is None:
            return
        expected = max(there.entries, self._anchor.entries)
        if session.log_before < expected:
            raise DamagedError(
                f"the log ends after {session.log_before:,} entries, but this home recorded"
                f" {expected:,}",
                hint=EXAMINE,
            )

    def _save_anchor(self, session: Session) -> None:
        """Tell the home how long the log is by now; an anchor that stays behind is right, too."""
        end = session.log_end
        if end is None or self._anchor is None:
            return
        self._anchor = replace(self._anchor, entries=end[0], hash=end[1])
        try:
            overwrite_anchor(self.settings.database_file, self._anchor)
        except OSError as error:
            if not self._anchor_refused:
                log.warning("home.json cannot be written", error=str(error))
            self._anchor_refused = True
        else:
            self._anchor_refused = False

    def listen(self, listener: Callable[[], None]) -> None:
        """Call a function after each commit of this process; it must be quick.

        Once ``subscribe`` was called, after those of others on the same server of databases, too.
        """
        self._listeners.append(listener)

    def subscribe(self) -> None:
        """Hear of what other processes commit, where the database tells."""
        self.sharing.subscribe(self._receive_notification)
        self.sharing.listen()

    def publish(self, word: str) -> None:
        """Say a word to the other processes, where there may be some; see ``sharing``."""
        if self.sharing.is_shared:
            with self.read_for_one_statement() as session:
                self.sharing.publish(session, word)

    def _receive_notification(self, word: str) -> None:
        if word in (COMMITTED, ALL_CHANGED):
            self.notify_listeners()

    def close(self) -> None:
        """Close all connections."""
        self.sharing.close()
        for engine in (self._engine, self._passing, self._peeker):
            if engine is not None:
                engine.dispose()
        try:
            flush_anchor_to_disk(self.settings.database_file)
        except OSError as error:
            # One that stays behind is right, too.
            log.warning("home.json cannot be synced", error=str(error))
        finally:
            self._lock.release()


def _open_engine(settings: Settings, alone: bool) -> Engine:
    dialect, engine = get_dialect(settings), make_engine(settings)
    if dialect.is_file:
        if alone:
            require_consistent_home_files(settings)
        create_private_file(settings.database_file)
    try:
        with translate_storage_errors(settings):
            dialect.require_supported_configuration(engine)
            if read_schema_revision(engine) is None:
                migrate_database_under_lock(settings, alone=alone)
            _require_schema(engine, settings)
            require_own_database(engine, settings)
            renew_anchor(engine, settings, alone=alone)
    except BaseException:
        engine.dispose()
        raise
    return engine


def _require_schema(engine: Engine, settings: Settings) -> None:
    revision = read_schema_revision(engine)
    if revision == SCHEMA_REVISION:
        return
    if revision in KNOWN_REVISIONS:
        raise StorageError(
            "the database was made by an older version of Touchline", hint="Run touchline migrate."
        )
    raise newer_schema_error(str(revision), settings)
