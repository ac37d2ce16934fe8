"""Records of jobs: rows that outlast the server, read, forgotten, and told of when they change."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from app.errors import ConflictError, NotFoundError, StorageError
from app.review.jobs.job_run import JobRun
from app.store.jobs import OPEN, Job, delete_job, read_job, read_jobs, update_job
from app.store.session import Session, Store

TICK = 0.25
"""Seconds between two looks at the progress of the running job."""

Listener = Callable[[Job], None]


class JobRecords:
    """What is kept of the jobs of a home, and who wants to hear of them."""

    def __init__(self, store: Store):
        self._store = store
        self._listeners: list[Listener] = []

    def listen(self, listener: Listener) -> None:
        """Call a function, on the worker's thread, whenever a job changes; it must be quick."""
        self._listeners.append(listener)

    def get(self, job_id: int) -> Job:
        """A job as it stands.

        Raises:
            NotFoundError: There is none of that id.
        """
        with self._store.read() as session:
            return need_job(session, job_id)

    def find(
        self,
        *,
        dataset_id: int | None = None,
        kinds: Sequence[str] = (),
        states: Sequence[str] = (),
        before: int | None = None,
        limit: int = 50,
    ) -> list[Job]:
        """Jobs, the newest first; ``before`` is the id of the last one of the page before."""
        with self._store.read() as session:
            return read_jobs(
                session,
                dataset_id=dataset_id,
                kinds=kinds,
                states=states,
                before=before,
                limit=limit,
            )

    def forget(self, job_id: int) -> None:
        """Delete the record of a job that is over.

        Raises:
            NotFoundError: There is none of that id.
            ConflictError: It is not over.
        """
        with self._store.write() as session:
            if need_job(session, job_id).state in OPEN:
                raise ConflictError(f"job {job_id} is not over yet", hint="Cancel it first.")
            delete_job(session, job_id)

    def _tick(self, run: JobRun, ended: threading.Event) -> None:
        """Keep the record in step with the progress, off the work's own thread: the work may hold
        the write lock when it tells how far it is."""
        shown = run.progress.place
        while not ended.wait(TICK):
            if run.progress.place != shown:
                shown = run.progress.place
                with suppress(StorageError):
                    self._save(run.id, **run.columns)

    def _save(self, job_id: int, **values: Any) -> None:
        with self._store.write() as session:
            update_job(session, job_id, **values)
            job = read_job(session, job_id)
        if job is not None:
            self._announce(job)

    def _announce(self, job: Job) -> None:
        for listener in self._listeners:
            listener(job)


def need_job(session: Session, job_id: int) -> Job:
    """A job by its id; raises NotFoundError without one."""
    job = read_job(session, job_id)
    if job is None:
        raise NotFoundError(f"there is no job {job_id}")
    return job
