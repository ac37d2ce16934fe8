"""A check-up of object stores: whether they answer, list, can be read and, for exports, written."""

from __future__ import annotations

import secrets
from itertools import islice

from app.config import Settings
from app.errors import ReviewError
from app.object_store.store import ChangedObjectError, ObjectStore, open_store
from app.review.doctor.check import Check

KEYS = "Correct TOUCHLINE_STORES or the file of keys: docs/operations.md says what a store needs."
CONDITIONS = "Update the store, or use another one: docs/operations.md says which."
_UNCONDITIONAL = (
    "reads whatever is there, although another content was asked for (If-Match): a frame that was"
    " changed would be shown as the imported one"
)
_PROBE = ".touchline-check"
_NO_CONTENT = '"touchline-asks-for-no-content"'
"""What no store calls any content."""


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
            if not _keeps_apart(store, found.key):
                return Check(title, False, _UNCONDITIONAL, CONDITIONS)
        if store.settings.exports:
            _write(store)
            done.append("writes")
    except ReviewError as error:
        can = f"; it {' and '.join(done)}" if done else ""
        return Check(title, False, f"{error.message}{can}", KEYS)
    empty = "" if found is not None else ", and nothing is in it"
    return Check(title, True, f"{', '.join(done)}{empty}")


def _keeps_apart(store: ObjectStore, key: str) -> bool:
    """Whether an object is not given out as the content that it is not."""
    try:
        store.read(key, 0, 1, _NO_CONTENT)
    except ChangedObjectError:
        return True
    return False


def _write(store: ObjectStore) -> None:
    key = f"{_PROBE}-{secrets.token_hex(4)}"
    store.put(key, b"Touchline writes and deletes this to see that it can.\n")
    store.delete(key)
