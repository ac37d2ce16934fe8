"""Codes of a second factor: of an authenticator (TOTP, RFC 6238), and for when that is lost.

What a database holds is a salt: the secret is made of it and a key that lies in the home alone, in
no backup. Recovery codes are kept as hashes.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import secrets
from datetime import datetime

import pyotp

from app.review.people.tokens import hash_of
from app.store.keys import SECOND_FACTOR, installation_key
from app.store.second_factors import find_second_factor, use_recovery_code, use_step
from app.store.session import Session
from app.store.store import Store

DIGITS, SECONDS = 6, 30
"""Of a code, and for how long it is shown."""
SKEW = 1
"""So many codes before and after count as well: clocks differ."""
CODE_BYTES = 10
"""Random bytes of a recovery code."""


def take_code(session: Session, store: Store, person_id: int, code: str, at: datetime) -> bool:
    """Whether a code is right at a time, of an authenticator or a recovery code; it is then used."""
    text = plain(code)
    if len(text) == DIGITS:
        return take_totp(session, store, person_id, text, at)
    return use_recovery_code(session, person_id, hash_of(text))


def take_totp(session: Session, store: Store, person_id: int, code: str, at: datetime) -> bool:
    """The same of the code of an authenticator, of a second factor that is not confirmed too."""
    found = find_second_factor(session, person_id)
    if found is None:
        return False
    totp, step = totp_of(store, person_id, found.salt), int(at.timestamp()) // SECONDS
    given = plain(code).encode("utf-8", "replace")
    right = [
        near
        for near in range(step - SKEW, step + SKEW + 1)
        if hmac.compare_digest(totp.generate_otp(near).encode(), given)
    ]
    return bool(right) and use_step(session, person_id, right[0])


def totp_of(store: Store, person_id: int, salt: str) -> pyotp.TOTP:
    """The secret of a person, of what the database and of what the home alone knows."""
    text = f"{person_id} {salt}".encode()
    digest = hmac.new(
        installation_key(store.settings, SECOND_FACTOR), text, hashlib.sha256
    ).digest()
    return pyotp.TOTP(base64.b32encode(digest[:20]).decode(), interval=SECONDS)


def new_code() -> str:
    """A new recovery code, as people read it."""
    text = base64.b32encode(secrets.token_bytes(CODE_BYTES)).decode().lower()
    return "-".join(text[at : at + 4] for at in range(0, len(text), 4))


def plain(code: str) -> str:
    """A code as it is compared: people copy it with spaces, and in capitals."""
    return code.strip().lower().replace("-", "").replace(" ", "")
