"""Upkeep: what a server deletes and checks from time to time, and the numbers of how a home is doing."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import TypeVar

import structlog

from app.config import Settings
from app.db.home import delete_leftovers
from app.db.idempotency import delete_old_responses, delete_oldest_response_bodies
from app.db.log import find_newest_entry_id
from app.db.recovery.anchor import flush_anchor_to_disk
from app.db.recovery.preopen_check import find_write_ahead_log_file
from app.db.session import format_utc_time
from app.db.store import Store
from app.errors import ReviewError
from app.features.datasets.queries import delete_expired_cache_entries
from app.features.datasets.service import delete_unused_calibrations
from app.features.exports.jobs import ExportFolder
from app.features.imports.upload_queries import expire_uploads
from app.features.jobs.queries import count_jobs, delete_old_jobs
from app.features.jobs.service import Jobs
from app.features.queue.queries import read_solving_backlog
from app.features.webhooks.queries import delete_finished_deliveries, has_finished_deliveries

log = structlog.get_logger("touchline.upkeep")

T = TypeVar("T")

FIRST_SECONDS, BETWEEN_SECONDS, BUSY_SECONDS = 60.0, 3600.0, 60.0
"""After the start, between two rounds, and until the next look while jobs are under way."""
ROUNDS_BETWEEN_CHECKS = 24
"""SQLite looks at every page of the database once in so many rounds."""
DELIVERIES_KEPT = timedelta(days=30)
"""How long it is known what webhooks were told."""


@dataclass(frozen=True)
class CleanupCounts:
    """How many of each went."""

    answers: int = 0
    jobs: int = 0
    uploads: int = 0
    cached: int = 0
    leftovers: int = 0
    exports: int = 0
    expired_exports: int = 0
    calibrations: int = 0
    deliveries: int = 0


def clean_up(store: Store, wanted: Callable[[], bool] = lambda: True) -> CleanupCounts:
    """Take away what is older or larger than the settings allow, and what nothing uses.

    Every step is a short transaction of its own, safe to be killed in. One that fails is logged,
    and the others are done all the same.

    Args:
        store: Of the home.
        wanted: Asked before each step; where it says no, the rest is left.
    """
    settings = store.settings
    steps: dict[str, Callable[[], int]] = {
        "answers": lambda: _delete_excess_responses(store),
        "jobs": lambda: _delete_old_jobs(store),
        "uploads": lambda: expire_uploads(settings),
        "cached": lambda: delete_expired_cache_entries(settings),
        "leftovers": lambda: delete_leftovers(settings),
        "exports": lambda: ExportFolder(settings.exports).delete_unfinished_zips(),
        "expired_exports": lambda: ExportFolder(settings.exports).delete_expired_zips(
            settings.export_days
        ),
        "calibrations": lambda: delete_unused_calibrations(store, wanted),
        "deliveries": lambda: delete_old_deliveries(store),
    }
    gone = {name: _run_step(name, step) or 0 for name, step in steps.items() if wanted()}
    _run_step("anchor", lambda: flush_anchor_to_disk(settings.database_file))
    return CleanupCounts(**gone)


def _run_step(name: str, step: Callable[[], T]) -> T | None:
    """What a step returns; None where it fails, which the log tells."""
    try:
        return step()
    except (ReviewError, OSError) as error:
        log.error("upkeep failed", step=name, error=str(error))
    except Exception:
        log.exception("upkeep failed", step=name)
    return None


def _delete_excess_responses(store: Store) -> int:
    with store.write() as session:
        deleted = delete_old_responses(session)
        return deleted + delete_oldest_response_bodies(session, store.settings.answer_bytes)


def _delete_old_jobs(store: Store) -> int:
    with store.write() as session:
        return delete_old_jobs(session, store.settings.job_days)


def delete_old_deliveries(store: Store, at: datetime | None = None) -> int:
    """Forget what webhooks were told long before a time (None: now); returns how many messages.

    Nothing is written where there is none.
    """
    before = (at or datetime.now(UTC)) - DELIVERIES_KEPT
    text = format_utc_time(before)
    with store.read() as session:
        if not has_finished_deliveries(session, text):
            return 0
    with store.write() as session:
        return delete_finished_deliveries(session, text)


class UpkeepScheduler:
    """Tidies from time to time, on a thread of its own, while no job is under way."""

    def __init__(self, store: Store, jobs: Jobs):
        self._store, self._jobs = store, jobs
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        self._rounds = 0

    def start(self) -> None:
        """Begin, some time after the start."""
        self._thread = threading.Thread(target=self._run_until_stopped, name="upkeep", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Tell it to end after the step that is under way; a look at the whole database ends there."""
        self._closing.set()

    def close(self, seconds: float = BUSY_SECONDS) -> None:
        """Stop, and wait so long for the end of the step that is under way."""
        self.stop()
        if self._thread is not None:
            self._thread.join(seconds)

    def _run_until_stopped(self) -> None:
        wait = FIRST_SECONDS
        while not self._closing.wait(wait):
            wait = BUSY_SECONDS
            if self._jobs.is_leader() and self._jobs.is_idle():
                self.run_once()
                wait = BETWEEN_SECONDS

    def run_once(self) -> None:
        """Tidy once, and look at the whole database once in a while."""
        self._rounds += 1
        tidied = clean_up(self._store, self._may_continue)
        if tidied != CleanupCounts():
            log.info("tidied", **vars(tidied))
        if self._rounds % ROUNDS_BETWEEN_CHECKS == 1:
            _run_step("check", lambda: self._store.require_intact_database(self._may_continue))

    def _may_continue(self) -> bool:
        return not self._closing.is_set()


@dataclass(frozen=True)
class HomeReport:
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


def read_home_report(store: Store) -> HomeReport:
    """The home of this moment, read in one short transaction.

    Raises:
        StorageError: The database does not answer.
    """
    with store.read() as session:
        groups, unsolved, oldest = read_solving_backlog(session)
        entries, jobs = find_newest_entry_id(session), count_jobs(session)
    settings = store.settings
    free = shutil.disk_usage(settings.home).free
    return HomeReport(
        groups, unsolved, oldest, entries, jobs, read_database_file_sizes(settings), free
    )


def read_database_file_sizes(settings: Settings) -> dict[str, int]:
    """Bytes of the database and of its write-ahead log, where they are."""
    database, sizes = settings.database_file, {}
    for name, path in {"database": database, "wal": find_write_ahead_log_file(database)}.items():
        # SQLite deletes its log when the last connection is closed.
        with suppress(FileNotFoundError):
            sizes[name] = path.stat().st_size
    return sizes
