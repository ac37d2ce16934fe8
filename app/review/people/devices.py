"""Devices: browsers from which a person has logged in, told from strangers who guess their password.

Who guesses a name's password from many addresses uses up the tries of unknown devices; the person's own
browser has tries of its own, so nobody is locked out by others (OWASP's device cookies).
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from collections.abc import Callable
from datetime import UTC, datetime, timedelta

from app.store.keys import DEVICES, installation_key
from app.store.people import person_by_name
from app.store.store import Store

LASTS = timedelta(days=400)
"""Browsers keep no cookie for longer, and after so long a device is unknown."""
_NONCE_BYTES = 16


class Devices:
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
        return f"{issued}.{nonce}.{self._signature(name, issued, nonce)}"

    def recognise(self, name: str, token: str) -> str | None:
        """What tells a device from others, if its token is one of this person; else None."""
        issued, _, rest = token.partition(".")
        nonce, _, signature = rest.partition(".")
        # As bytes: what is sent may hold letters that are none of ASCII.
        known = self._signature(name, issued, nonce).encode()
        if not hmac.compare_digest(known, signature.encode("utf-8", "replace")):
            return None
        is_old = self._clock().timestamp() - int(issued) > LASTS.total_seconds()
        return None if is_old else nonce

    def cookie_of(self, name: str) -> str:
        """What ends the name of a person's cookie: several people may use one browser."""
        return hashlib.sha256(_folded(name)).hexdigest()[:12]

    def _signature(self, name: str, issued: str, nonce: str) -> str:
        key = installation_key(self._store.settings, DEVICES)
        with self._store.glance() as session:
            person = person_by_name(session, name.strip().lower())
        password = "" if person is None else person.password or ""
        parts = (_folded(name), issued.encode("utf-8", "replace"), nonce.encode("utf-8", "replace"))
        text = b"\n".join((*parts, hashlib.sha256(password.encode()).digest()))
        return hmac.new(key, text, hashlib.sha256).hexdigest()


def _folded(name: str) -> bytes:
    return name.strip().lower().encode("utf-8", "replace")
