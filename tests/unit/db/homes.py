"""Homes with something in them, and as a killed server leaves them."""

from __future__ import annotations

import shutil
from pathlib import Path

from sqlalchemy import text

from app.config import Settings
from app.db.log import NewLogEntry, append_entries, read_log
from app.db.session import now
from app.db.store import Store

INSERT = "INSERT INTO dataset (name, created, policy, policy_hash) VALUES ('{}', '', '', '')"
FILES = ("touchline.db", "touchline.db-wal", "home.json")
"""What lies on the disk while a store is open."""


def names(store: Store) -> list[str]:
    """Of its datasets."""
    with store.read() as session:
        return list(session.scalars(text("SELECT name FROM dataset ORDER BY id")))


def add(store: Store, name: str) -> None:
    """Add a dataset."""
    with store.write() as session:
        session.execute(text(INSERT.format(name)))


def say(store: Store, times: int = 1) -> None:
    """Entries of the log, each in a transaction of its own, of a size that makes pages full."""
    for number in range(times):
        with store.write() as session:
            append_entries(
                session, [NewLogEntry("dataset", "ann", now(), {"n": number, "x": "y" * 900})]
            )


def log_ids(store: Store) -> list[int]:
    with store.read() as session:
        return [entry.id for entry in read_log(session)]


def killed(store: Store, home: Path, *names: str) -> Settings:
    """A home with the files that a store would leave if it were killed now."""
    home.mkdir(exist_ok=True)
    for name in names or FILES:
        shutil.copy(store.settings.home / name, home / name)
    return Settings(home=home)
