"""Homes as a killed server leaves them: what lies on the disk while a store is open."""

from __future__ import annotations

import shutil
from pathlib import Path

from app.config import Settings
from app.store.clock import now
from app.store.log import Entry, append
from app.store.store import Store

FILES = ("touchline.db", "touchline.db-wal", "home.json")


def say(store: Store, times: int = 1) -> None:
    """Entries of the log, each in a transaction of its own, of a size that makes pages full."""
    for number in range(times):
        with store.write() as session:
            append(session, [Entry("dataset", "ann", now(), {"n": number, "x": "y" * 900})])


def killed(store: Store, home: Path, *names: str) -> Settings:
    """A home with the files that a store would leave if it were killed now."""
    home.mkdir(exist_ok=True)
    for name in names or FILES:
        shutil.copy(store.settings.home / name, home / name)
    return Settings(home=home)
