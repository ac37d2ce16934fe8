"""Vitals: the few numbers that tell an operator how a home is doing."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime

from app.config import Settings
from app.store.jobs import count_jobs
from app.store.listing import count_unsolved
from app.store.log import newest_entry
from app.store.recovery.preopen_check import log_file
from app.store.store import Store


@dataclass(frozen=True)
class Home:
    """A home as its operator sees it.

    Attributes:
        groups: How many there are.
        unsolved: How many wait to be solved.
        oldest_unsolved: Since when the one that waits longest does (UTC); None: none waits.
        entries: Length of the log.
        jobs: How many jobs there are, by kind and state.
        file_bytes: Bytes of ``database`` and ``wal``.
        free_bytes: Room on the disk of the home.
    """

    groups: int
    unsolved: int
    oldest_unsolved: str | None
    entries: int
    jobs: Mapping[tuple[str, str], int]
    file_bytes: dict[str, int]
    free_bytes: int

    @property
    def oldest_unsolved_seconds(self) -> float:
        """How long the oldest group waits to be solved; 0: none waits."""
        if self.oldest_unsolved is None:
            return 0.0
        waits = datetime.now(UTC) - datetime.fromisoformat(self.oldest_unsolved)
        return max(0.0, waits.total_seconds())


def read_home(store: Store) -> Home:
    """The home of this moment, read in one short transaction.

    Raises:
        StorageError: The database does not answer.
    """
    with store.read() as session:
        groups, unsolved, oldest = count_unsolved(session)
        entries, jobs = newest_entry(session), count_jobs(session)
    settings = store.settings
    free = shutil.disk_usage(settings.home).free
    return Home(groups, unsolved, oldest, entries, jobs, file_sizes(settings), free)


def file_sizes(settings: Settings) -> dict[str, int]:
    """Bytes of the database and of its write-ahead log, where they are."""
    database, sizes = settings.database_file, {}
    for name, path in {"database": database, "wal": log_file(database)}.items():
        # SQLite deletes its log when the last connection is closed.
        with suppress(FileNotFoundError):
            sizes[name] = path.stat().st_size
    return sizes
