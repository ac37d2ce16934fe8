"""Claims by advisory locks of a connection, words by NOTIFY (PostgreSQL 15, 13.3.5 and NOTIFY)."""

from __future__ import annotations

import hashlib
import secrets
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

import structlog
from sqlalchemy import Connection, Engine, text
from sqlalchemy.exc import DBAPIError

from app.db.dialects.dialect import ALL_CHANGED, Hearer
from app.db.session import Session
from app.errors import StorageError

log = structlog.get_logger("touchline.store")

CHANNEL = "touchline"
MOST_LETTERS = 7000
"""PostgreSQL carries no more than 8,000 bytes; longer words are not said."""
POLL_SECONDS = 0.5
"""Between two looks whether the process ends."""
AGAIN_SECONDS = 1.0
"""Until a broken line is taken up again."""

Reported = Callable[[], AbstractContextManager[None]]


class PostgreSQLCoordinator:
    """What processes share through one PostgreSQL.

    Args:
        engine: Makes connections; each of the two that are used is kept.
        reported: Turns what the database refuses into a ``StorageError``.
    """

    is_shared = True

    def __init__(self, engine: Engine, reported: Reported):
        self._engine = engine.execution_options(isolation_level="AUTOCOMMIT")
        self._reported = reported
        self._origin = secrets.token_hex(6)
        self._lock = threading.Lock()
        self._claiming: Connection | None = None
        self._held: set[str] = set()
        self._hearers: list[Hearer] = []
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None

    def claim(self, name: str) -> bool:
        """See ``Sharing``."""
        with self._lock, self._reported():
            if name in self._held or self._closing.is_set():
                return False
            if not self._query_claim("SELECT pg_try_advisory_lock(:key)", name):
                return False
            self._held.add(name)
            return True

    def holds(self, name: str) -> bool:
        """See ``Sharing``; the server is asked, for a claim ends with its connection."""
        with self._lock:
            if name not in self._held:
                return False
            try:
                with self._reported():
                    self._query_claim("SELECT :key", name)
            except StorageError:
                return False
            return name in self._held

    def release(self, name: str) -> None:
        """See ``Sharing``."""
        with self._lock:
            if name in self._held:
                self._held.discard(name)
                try:
                    with self._reported():
                        self._query_claim("SELECT pg_advisory_unlock(:key)", name)
                except StorageError as error:
                    # With the connection the claim is gone, too.
                    log.warning("a claim ended with its connection", error=error.message)

    def publish(self, session: Session, word: str) -> None:
        """See ``Sharing``."""
        message = f"{self._origin} {word}"
        if len(message.encode()) <= MOST_LETTERS:
            session.execute(_NOTIFY, {"channel": CHANNEL, "said": message})

    def subscribe(self, hearer: Hearer) -> None:
        """See ``Sharing``."""
        self._hearers.append(hearer)

    def listen(self) -> None:
        """See ``Sharing``."""
        if self._thread is None:
            self._thread = threading.Thread(
                target=self._listen_until_closed, name="listener", daemon=True
            )
            self._thread.start()

    def close(self) -> None:
        """See ``Sharing``."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
        with self._lock:
            self._close_claiming_connection()

    def _query_claim(self, statement: str, name: str) -> Any:
        """What the connection with the claims answers; a broken one takes them along."""
        try:
            if self._claiming is None:
                self._claiming = self._engine.connect()
            return self._claiming.execute(text(statement), {"key": _hash_lock_name(name)}).scalar()
        except DBAPIError:
            self._close_claiming_connection()
            raise

    def _close_claiming_connection(self) -> None:
        connection, self._claiming = self._claiming, None
        self._held.clear()
        if connection is not None:
            # Not given to others: it may hold locks.
            connection.invalidate()
            connection.close()

    def _listen_until_closed(self) -> None:
        while not self._closing.is_set():
            try:
                with self._engine.connect() as connection:
                    self._receive_notifications(connection)
            except Exception as error:
                log.warning(
                    "notifications of other processes cannot be received",
                    error=type(error).__name__,
                )
                self._closing.wait(AGAIN_SECONDS)

    def _receive_notifications(self, connection: Connection) -> None:
        try:
            connection.execute(text(f"LISTEN {CHANNEL}"))
            self._notify_subscribers(ALL_CHANGED)
            driver: Any = connection.connection.driver_connection
            while not self._closing.is_set():
                for notice in driver.notifies(timeout=POLL_SECONDS):
                    origin, _, word = notice.payload.partition(" ")
                    if origin != self._origin:
                        self._notify_subscribers(word)
                    if self._closing.is_set():
                        return
        finally:
            # Nobody else shall get a connection that listens.
            connection.invalidate()

    def _notify_subscribers(self, word: str) -> None:
        for hearer in self._hearers:
            try:
                hearer(word)
            except Exception:
                log.exception("a notification of another process could not be handled", word=word)


_NOTIFY = text("SELECT pg_notify(:channel, :said)")


def _hash_lock_name(name: str) -> int:
    """The lock of a name, 64 bits with a sign."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], signed=True)
