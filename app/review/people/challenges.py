"""Challenges: what a passkey has to sign, and what else is good once, for a short while."""

from __future__ import annotations

import secrets
from base64 import urlsafe_b64encode
from collections.abc import Callable
from datetime import datetime, timedelta
from threading import Lock
from typing import Protocol

from cryptography.fernet import Fernet

from app.review.people.tokens import hash_of
from app.store.clock import text_of
from app.store.keys import BEGUN, installation_key
from app.store.short_lived import put_begun, take_begun
from app.store.store import Store

LASTS = timedelta(minutes=5)
BYTES = 32
MOST = 10_000
"""So many are remembered; beyond it the oldest makes room."""

Clock = Callable[[], datetime]


class Waiting(Protocol):
    """What waits to be taken, for a short while."""

    def put(self, asker: str, value: bytes) -> None:
        """Let something wait for somebody, in the place of what did."""

    def take(self, asker: str) -> bytes | None:
        """What waits for somebody, and from then on does not; None where nothing does that is good."""


class Remembered:
    """What waits in the memory of this process: a restart forgets it.

    Args:
        clock: Says what time it is, in UTC.
        lasts: How long something waits.
    """

    def __init__(self, clock: Clock, lasts: timedelta):
        self._clock, self._lasts, self._lock = clock, lasts, Lock()
        self._open: dict[str, tuple[bytes, datetime]] = {}

    def put(self, asker: str, value: bytes) -> None:
        """See ``Waiting``."""
        at = self._clock()
        with self._lock:
            self._open.pop(asker, None)
            # They lie in the order in which they end.
            while self._open and (len(self._open) >= MOST or self._oldest_ended(at)):
                del self._open[next(iter(self._open))]
            self._open[asker] = value, at + self._lasts

    def take(self, asker: str) -> bytes | None:
        """See ``Waiting``."""
        with self._lock:
            value, ends = self._open.pop(asker, (None, None))
        return value if ends is not None and self._clock() < ends else None

    def _oldest_ended(self, at: datetime) -> bool:
        return next(iter(self._open.values()))[1] <= at


class Written:
    """What waits in the database, for whichever process is asked next; encrypted with a key of the home.

    Args:
        store: The database.
        clock: Says what time it is, in UTC.
        lasts: How long something waits.
        kind: What it is: askers of several kinds may have the same name.
    """

    def __init__(self, store: Store, clock: Clock, lasts: timedelta, kind: str):
        self._store, self._clock, self._lasts, self._kind = store, clock, lasts, kind

    def put(self, asker: str, value: bytes) -> None:
        """See ``Waiting``."""
        at = self._clock()
        closed, ends = self._key().encrypt(value), text_of(at + self._lasts)
        with self._store.write(lasting=False) as session:
            put_begun(session, self._name(asker), closed, ends, text_of(at), MOST)

    def take(self, asker: str) -> bytes | None:
        """See ``Waiting``."""
        with self._store.write() as session:
            closed = take_begun(session, self._name(asker), text_of(self._clock()))
        return None if closed is None else self._key().decrypt(closed)

    def _name(self, asker: str) -> str:
        return hash_of(f"{self._kind}/{asker}")

    def _key(self) -> Fernet:
        return Fernet(urlsafe_b64encode(installation_key(self._store.settings, BEGUN)))


def waiting(store: Store, clock: Clock, lasts: timedelta, kind: str) -> Waiting:
    """What waits, where every process finds it that may be asked for it."""
    if store.sharing.is_shared:
        return Written(store, clock, lasts, kind)
    return Remembered(clock, lasts)


class Challenges:
    """Challenges of passkeys."""

    def __init__(self, waiting: Waiting):
        self._waiting = waiting

    def make(self, asker: str) -> bytes:
        """A challenge for somebody, in the place of the one that they had."""
        challenge = secrets.token_bytes(BYTES)
        self._waiting.put(asker, challenge)
        return challenge

    def take(self, asker: str) -> bytes | None:
        """The challenge of somebody, who has none then; None where none is good."""
        return self._waiting.take(asker)
