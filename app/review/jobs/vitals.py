"""Vitals: what an operator watches, read in one short transaction."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from datetime import UTC, datetime

from app.store.session import Store
from app.store.vitals import Vitals, file_sizes, read_vitals


@dataclass(frozen=True)
class Home:
    """A home as its operator sees it.

    Attributes:
        vitals: Numbers of the database.
        oldest_unsolved_seconds: How long the oldest group waits to be solved; 0: none waits.
        file_bytes: Bytes of ``database`` and ``wal``.
        free_bytes: Room on the disk of the home.
    """

    vitals: Vitals
    oldest_unsolved_seconds: float
    file_bytes: dict[str, int]
    free_bytes: int


def read_home(store: Store) -> Home:
    """The home of this moment.

    Raises:
        StorageError: The database does not answer.
    """
    with store.read() as session:
        vitals = read_vitals(session)
    settings = store.settings
    free = shutil.disk_usage(settings.home).free
    return Home(vitals, _age(vitals.oldest_unsolved), file_sizes(settings), free)


def _age(at: str | None) -> float:
    if at is None:
        return 0.0
    return max(0.0, (datetime.now(UTC) - datetime.fromisoformat(at)).total_seconds())
