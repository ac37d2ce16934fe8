"""Store: the database of a home, its reads and its writes."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from sqlalchemy import Engine
from sqlalchemy.orm import Session as Session

from app.config import Settings
from app.errors import StorageError
from app.store.engine import WRITE, make_engine, reported, require_pragmas
from app.store.home import make_home
from app.store.migrate import KNOWN_REVISIONS, SCHEMA_REVISION, migrate, schema_revision

TURN_SECONDS = 10.0
"""How long a thread waits for the writes of others in its process; SQLite waits for other
processes (``busy_timeout``)."""


class Turn:
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
    """

    def __init__(self, engine: Engine, settings: Settings, turn: AbstractContextManager[object]):
        self.settings = settings
        self._engine = engine
        self._writer = engine.execution_options(**WRITE)
        self.turn = turn
        self._listeners: list[Callable[[], None]] = []

    @staticmethod
    def open(settings: Settings, turn: AbstractContextManager[object] | None = None) -> Store:
        """Open the database; an empty home is migrated, an older one must be first.

        Args:
            settings: Where it lies.
            turn: The turn to write, where it is shared with another process.

        Raises:
            StorageError: The schema is older or newer than this version's, or the file is not
                a database, or SQLite does not keep the promises asked of it.
            InputError: The URL is not one of SQLite.
        """
        make_home(settings)
        engine = make_engine(settings)
        with reported(settings):
            require_pragmas(engine)
            if schema_revision(engine) is None:
                migrate(settings)
            _require_schema(engine)
        return Store(engine, settings, Turn() if turn is None else turn)

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A session on one consistent snapshot; nothing that it changes is kept."""
        with reported(self.settings), Session(self._engine, autoflush=False) as session:
            yield session

    @contextmanager
    def write(self) -> Iterator[Session]:
        """A session that holds the database's write lock from its start and commits at its end.

        Threads of one process wait for their turn here, processes in SQLite. It does not nest.

        Raises:
            StorageError: Others were writing all the while; nothing was changed.
        """
        with self.turn, reported(self.settings), Session(self._writer) as session:
            # Take the lock before anything is read, so that what is read is still true when it
            # is written.
            session.connection()
            yield session
            session.commit()
        for listener in self._listeners:
            listener()

    def listen(self, listener: Callable[[], None]) -> None:
        """Call a function after each commit of this process; it must be quick."""
        self._listeners.append(listener)

    def close(self) -> None:
        """Close all connections."""
        self._engine.dispose()


def _require_schema(engine: Engine) -> None:
    revision = schema_revision(engine)
    if revision == SCHEMA_REVISION:
        return
    if revision in KNOWN_REVISIONS:
        raise StorageError(
            "the database was made by an older version of Touchline", hint="Run touchline migrate."
        )
    raise StorageError(
        f"the database was made by a newer version of Touchline (schema {revision})",
        hint="Update Touchline; an older version would damage the data.",
    )
