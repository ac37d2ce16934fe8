"""Devices from which a person has logged in.

Attempts are counted against a limit; challenges and codes are good once.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import secrets
import time
from base64 import urlsafe_b64encode
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from threading import Lock
from typing import Protocol

import pyotp
from cryptography.fernet import Fernet

from app.db.home import BEGUN, DEVICES, SECOND_FACTOR, get_or_make_secret_key
from app.db.session import Session, format_utc_time
from app.db.store import Store
from app.features.people.links import hash_token
from app.features.people.login_queries import (
    find_blocking_attempt,
    insert_login_attempt,
    store_pending_action,
    take_pending_action,
)
from app.features.people.queries import (
    delete_recovery_code,
    find_person_by_name,
    find_second_factor,
    save_used_totp_step,
)

LASTS = timedelta(days=400)
"""Browsers keep no cookie for longer, and after so long a device is unknown."""
_NONCE_BYTES = 16


class DeviceTokens:
    """Makes and recognises the tokens that browsers keep after a login.

    A token ends after ``LASTS``, and with the password that its person had then.

    Args:
        store: Of the home that holds the key of the tokens, and of people.
        clock: Says what time it is, in UTC.
    """

    def __init__(self, store: Store, clock: Callable[[], datetime] = lambda: datetime.now(UTC)):
        self._store, self._clock = store, clock

    def make(self, name: str) -> str:
        """A new token for the browser of a person."""
        issued = str(int(self._clock().timestamp()))
        nonce = secrets.token_hex(_NONCE_BYTES)
        return f"{issued}.{nonce}.{self._compute_signature(name, issued, nonce)}"

    def recognise(self, name: str, token: str) -> str | None:
        """What tells a device from others, if its token is one of this person; else None."""
        issued, _, rest = token.partition(".")
        nonce, _, signature = rest.partition(".")
        # As bytes: what is sent may hold letters that are none of ASCII.
        known = self._compute_signature(name, issued, nonce).encode()
        if not hmac.compare_digest(known, signature.encode("utf-8", "replace")):
            return None
        is_old = self._clock().timestamp() - int(issued) > LASTS.total_seconds()
        return None if is_old else nonce

    def make_cookie_suffix(self, name: str) -> str:
        """What ends the name of a person's cookie: several people may use one browser."""
        return hashlib.sha256(_normalize_name(name)).hexdigest()[:12]

    def _compute_signature(self, name: str, issued: str, nonce: str) -> str:
        key = get_or_make_secret_key(self._store.settings, DEVICES)
        with self._store.read_for_one_statement() as session:
            person = find_person_by_name(session, name.strip().lower())
        password = "" if person is None else person.password or ""
        parts = (
            _normalize_name(name),
            issued.encode("utf-8", "replace"),
            nonce.encode("utf-8", "replace"),
        )
        text = b"\n".join((*parts, hashlib.sha256(password.encode()).digest()))
        return hmac.new(key, text, hashlib.sha256).hexdigest()


def _normalize_name(name: str) -> bytes:
    return name.strip().lower().encode("utf-8", "replace")


class AttemptWindow:
    """Tries in a moving window.

    Args:
        store: Where they are counted.
        clock: Says what time it is, in seconds since 1970.
    """

    def __init__(self, store: Store, clock: Callable[[], float] = time.time):
        self._store, self._clock = store, clock

    def count_attempt_or_get_wait(self, whose: str, most: int, seconds: float) -> float | None:
        """Count a try; None, or after how many seconds there may be another where there were too many.

        Who is refused writes nothing: a flood keeps nobody from writing.
        """
        at, name = self._clock(), hash_token(whose)
        with self._store.read_for_one_statement() as session:
            oldest = find_blocking_attempt(session, name, at - seconds, most)
        if oldest is None:
            with self._store.write(lasting=False) as session:
                oldest = find_blocking_attempt(session, name, at - seconds, most)
                if oldest is None:
                    insert_login_attempt(session, name, at)
        return None if oldest is None else oldest + seconds - at


CHALLENGE_LASTS = timedelta(minutes=5)
BYTES = 32
MOST = 10_000
"""So many are remembered; beyond it the oldest makes room."""

Clock = Callable[[], datetime]


class PendingActionStore(Protocol):
    """What waits to be taken, for a short while."""

    def put(self, key: str, value: bytes) -> None:
        """Let something wait for somebody, in the place of what did."""

    def take(self, key: str) -> bytes | None:
        """What waits for somebody, and from then on does not; None where nothing does that is good."""


class InMemoryPendingActions:
    """What waits in the memory of this process: a restart forgets it.

    Args:
        clock: Says what time it is, in UTC.
        lasts: How long something waits.
    """

    def __init__(self, clock: Clock, lasts: timedelta):
        self._clock, self._lasts, self._lock = clock, lasts, Lock()
        self._open: dict[str, tuple[bytes, datetime]] = {}

    def put(self, key: str, value: bytes) -> None:
        """See ``PendingActionStore``."""
        at = self._clock()
        with self._lock:
            self._open.pop(key, None)
            # They lie in the order in which they end.
            while self._open and (len(self._open) >= MOST or self._has_oldest_expired(at)):
                del self._open[next(iter(self._open))]
            self._open[key] = value, at + self._lasts

    def take(self, key: str) -> bytes | None:
        """See ``PendingActionStore``."""
        with self._lock:
            value, ends = self._open.pop(key, (None, None))
        return value if ends is not None and self._clock() < ends else None

    def _has_oldest_expired(self, at: datetime) -> bool:
        return next(iter(self._open.values()))[1] <= at


class StoredPendingActions:
    """What waits in the database, for whichever process is asked next; encrypted with a key of the home.

    Args:
        store: The database.
        clock: Says what time it is, in UTC.
        lasts: How long something waits.
        kind: What it is: keys of several kinds may be the same.
    """

    def __init__(self, store: Store, clock: Clock, lasts: timedelta, kind: str):
        self._store, self._clock, self._lasts, self._kind = store, clock, lasts, kind

    def put(self, key: str, value: bytes) -> None:
        """See ``PendingActionStore``."""
        at = self._clock()
        closed, ends = self._encryption_key().encrypt(value), format_utc_time(at + self._lasts)
        with self._store.write(lasting=False) as session:
            store_pending_action(
                session, self._hash_name(key), closed, ends, format_utc_time(at), MOST
            )

    def take(self, key: str) -> bytes | None:
        """See ``PendingActionStore``."""
        with self._store.write() as session:
            closed = take_pending_action(
                session, self._hash_name(key), format_utc_time(self._clock())
            )
        return None if closed is None else self._encryption_key().decrypt(closed)

    def _hash_name(self, key: str) -> str:
        return hash_token(f"{self._kind}/{key}")

    def _encryption_key(self) -> Fernet:
        return Fernet(urlsafe_b64encode(get_or_make_secret_key(self._store.settings, BEGUN)))


def make_pending_action_store(
    store: Store, clock: Clock, lasts: timedelta, kind: str
) -> PendingActionStore:
    """The store of pending actions that every web process can read."""
    if store.sharing.is_shared:
        return StoredPendingActions(store, clock, lasts, kind)
    return InMemoryPendingActions(clock, lasts)


class PasskeyChallenges:
    """Challenges of passkeys."""

    def __init__(self, waiting: PendingActionStore):
        self._waiting = waiting

    def make(self, key: str) -> bytes:
        """A challenge for somebody, in the place of the one that they had."""
        challenge = secrets.token_bytes(BYTES)
        self._waiting.put(key, challenge)
        return challenge

    def take(self, key: str) -> bytes | None:
        """The challenge of somebody, who has none then; None where none is good."""
        return self._waiting.take(key)


DIGITS, SECONDS = 6, 30
"""Of a code, and for how long it is shown."""
SKEW = 1
"""So many codes before and after count as well: clocks differ."""
CODE_BYTES = 10
"""Random bytes of a recovery code."""


def verify_and_use_code(
    session: Session, store: Store, person_id: int, code: str, at: datetime
) -> bool:
    """Whether a code is right at a time, of an authenticator or a recovery code; it is then used."""
    text = normalize_code(code)
    if len(text) == DIGITS:
        return verify_and_use_totp(session, store, person_id, text, at)
    return delete_recovery_code(session, person_id, hash_token(text))


def verify_and_use_totp(
    session: Session, store: Store, person_id: int, code: str, at: datetime
) -> bool:
    """The same of the code of an authenticator, of a second factor that is not confirmed too."""
    found = find_second_factor(session, person_id)
    if found is None:
        return False
    totp, step = make_totp(store, person_id, found.salt), int(at.timestamp()) // SECONDS
    given = normalize_code(code).encode("utf-8", "replace")
    right = [
        near
        for near in range(step - SKEW, step + SKEW + 1)
        if hmac.compare_digest(totp.generate_otp(near).encode(), given)
    ]
    return bool(right) and save_used_totp_step(session, person_id, right[0])


def make_totp(store: Store, person_id: int, salt: str) -> pyotp.TOTP:
    """The secret of a person, of what the database and of what the home alone knows."""
    text = f"{person_id} {salt}".encode()
    digest = hmac.new(
        get_or_make_secret_key(store.settings, SECOND_FACTOR), text, hashlib.sha256
    ).digest()
    return pyotp.TOTP(base64.b32encode(digest[:20]).decode(), interval=SECONDS)


def make_recovery_code() -> str:
    """A new recovery code, as people read it."""
    text = base64.b32encode(secrets.token_bytes(CODE_BYTES)).decode().lower()
    return "-".join(text[at : at + 4] for at in range(0, len(text), 4))


def normalize_code(code: str) -> str:
    """A code as it is compared: people copy it with spaces, and in capitals."""
    return code.strip().lower().replace("-", "").replace(" ", "")
