"""Keys: what this installation alone knows. It is in no backup."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

from app.config import Settings
from app.durable import sync
from app.errors import DamagedError
from app.store.home import refused

SECOND_FACTOR, WEBHOOKS, BEGUN = "second-factor.key", "webhooks.key", "begun.key"
DEVICES = "devices.key"
KEYS = SECOND_FACTOR, WEBHOOKS, BEGUN, DEVICES
"""Files of keys: each is made for something that a database holds."""
_BYTES = 32


def installation_key(settings: Settings, name: str) -> bytes:
    """A random key of a home, made when it is asked for the first time; ``name`` is its file's.

    Raises:
        StorageError: The disk refuses.
        DamagedError: The file is there, and no key.
    """
    path = settings.home / name
    try:
        if not path.exists():
            _make(path)
        key = path.read_bytes()
    except OSError as error:
        raise refused(path, error) from error
    if len(key) != _BYTES:
        raise DamagedError(
            f"{path} is no key: it has {len(key)} bytes, not {_BYTES}",
            hint="Put the file back from a copy. Deleted, it is made anew; what it was for ends then.",
        )
    return key


def _make(path: Path) -> None:
    """Whole or not at all; of two that make one at a time, the first counts."""
    partial = path.with_name(f".{path.name}.{secrets.token_hex(8)}")
    try:
        descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "wb") as file:
            file.write(secrets.token_bytes(_BYTES))
            file.flush()
            os.fsync(file.fileno())
        try:
            os.link(partial, path)
        except FileExistsError:
            return
        sync(path.parent)
    finally:
        partial.unlink(missing_ok=True)
