"""Devices: browsers from which a person has logged in, told from strangers who guess their password.

Who guesses a name's password from many addresses uses up the tries of unknown devices; the person's own
browser has tries of its own, so nobody is locked out by others (OWASP's device cookies).
"""

from __future__ import annotations

import hashlib
import hmac
import secrets

from app.store.keys import DEVICES, installation_key
from app.store.store import Store

_NONCE_BYTES = 16


class Devices:
    """Makes and recognises the tokens that browsers keep after a login.

    Args:
        store: Of the home that holds the key of the tokens.
    """

    def __init__(self, store: Store):
        self._store = store

    def make(self, name: str) -> str:
        """A new token for the browser of a person."""
        nonce = secrets.token_hex(_NONCE_BYTES)
        return f"{nonce}.{self._signature(name, nonce)}"

    def recognise(self, name: str, token: str) -> str | None:
        """What tells a device from others, if its token is one of this person; else None."""
        nonce, _, signature = token.partition(".")
        # As bytes: what is sent may hold letters that are none of ASCII.
        known = self._signature(name, nonce).encode()
        return nonce if hmac.compare_digest(known, signature.encode("utf-8", "replace")) else None

    def _signature(self, name: str, nonce: str) -> str:
        key = installation_key(self._store.settings, DEVICES)
        text = f"{name.strip().lower()}\n{nonce}".encode("utf-8", "replace")
        return hmac.new(key, text, hashlib.sha256).hexdigest()
