"""Upkeep: what a server puts in order while nobody waits for it, so that a home does not only grow."""

from __future__ import annotations

import threading
from dataclasses import dataclass

import structlog

from app.errors import ReviewError
from app.review.datasets.spare_calibrations import delete_spare_calibrations
from app.review.jobs.jobs import Jobs
from app.store.anchor import sync_anchor
from app.store.answers import forget_answers, shorten_answers
from app.store.jobs import forget_jobs
from app.store.orphans import delete_leftovers, expire_cache
from app.store.session import Store
from app.store.uploads import expire_uploads

log = structlog.get_logger("touchline.upkeep")

FIRST_SECONDS, BETWEEN_SECONDS, BUSY_SECONDS = 60.0, 3600.0, 60.0
"""After the start, between two rounds, and until the next look while jobs are under way."""
ROUNDS_BETWEEN_CHECKS = 24
"""SQLite looks at every page of the database once in so many rounds."""


@dataclass(frozen=True)
class Tidied:
    """How many of each went."""

    answers: int = 0
    jobs: int = 0
    uploads: int = 0
    cached: int = 0
    leftovers: int = 0
    calibrations: int = 0


def tidy(store: Store) -> Tidied:
    """Take away what is older or larger than the settings allow, and what nothing uses.

    Every step is a short transaction of its own, safe to be killed in.
    """
    settings = store.settings
    with store.write() as session:
        answers = forget_answers(session) + shorten_answers(session, settings.answer_bytes)
    with store.write() as session:
        jobs = forget_jobs(session, settings.job_days)
    tidied = Tidied(
        answers=answers,
        jobs=jobs,
        uploads=expire_uploads(settings),
        cached=expire_cache(settings),
        leftovers=delete_leftovers(settings),
        calibrations=delete_spare_calibrations(store),
    )
    sync_anchor(settings.database_file)
    return tidied


class Upkeep:
    """Tidies from time to time, on a thread of its own, while no job is under way."""

    def __init__(self, store: Store, jobs: Jobs):
        self._store, self._jobs = store, jobs
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        self._rounds = 0

    def start(self) -> None:
        """Begin, some time after the start."""
        self._thread = threading.Thread(target=self._work, name="upkeep", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End after the step that is under way."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join(BUSY_SECONDS)

    def _work(self) -> None:
        wait = FIRST_SECONDS
        while not self._closing.wait(wait):
            wait = BUSY_SECONDS
            if self._jobs.are_idle():
                self.round()
                wait = BETWEEN_SECONDS

    def round(self) -> None:
        """Tidy once, and look at the whole database once in a while."""
        self._rounds += 1
        try:
            tidied = tidy(self._store)
            if tidied != Tidied():
                log.info("tidied", **vars(tidied))
            if self._rounds % ROUNDS_BETWEEN_CHECKS == 1:
                self._store.require_whole()
        except (ReviewError, OSError) as error:
            log.error("upkeep failed", error=str(error))
