"""A check-up of object stores: whether they answer, list, can be read and, for exports, written."""

from __future__ import annotations

import secrets
from itertools import islice

from app.config import Settings
from app.errors import ReviewError
from app.object_store.store import ObjectStore, open_store
from app.review.editing.check import Check

KEYS = "Correct TOUCHLINE_STORES or the file of keys: docs/operations.md says what a store needs."
_PROBE = ".touchline-check"


def examine_stores(settings: Settings) -> list[Check]:
    """Ask every configured store for what the service needs of it."""
    return [_examine(settings, name) for name in sorted(settings.stores)]


def _examine(settings: Settings, name: str) -> Check:
    title, done = f"store {name}", list[str]()
    try:
        store = open_store(settings, name)
        found = next(islice(store.below(""), 1), None)
        done.append("lists")
        if found is not None and found.size:
            store.read(found.key, 0, 1, found.etag)
            done.append("reads")
        if store.settings.exports:
            _write(store)
            done.append("writes")
    except ReviewError as error:
        can = f"; it {' and '.join(done)}" if done else ""
        return Check(title, False, f"{error.message}{can}", KEYS)
    empty = "" if found is not None else ", and nothing is in it"
    return Check(title, True, f"{', '.join(done)}{empty}")


def _write(store: ObjectStore) -> None:
    key = f"{_PROBE}-{secrets.token_hex(4)}"
    store.put(key, b"Touchline writes and deletes this to see that it can.\n")
    store.delete(key)
