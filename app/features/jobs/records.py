"""Records of jobs: rows that outlast the server, read, forgotten, and told of when they change."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError, NotFoundError, StorageError
from app.features.audit.service import add_audit_event
from app.features.jobs.job_run import JobRun
from app.features.jobs.queries import DONE as DONE
from app.features.jobs.queries import (
    FAILED,
    OPEN,
    delete_job,
    find_end_time,
    list_job_ids_of_kind,
    read_job,
    read_jobs,
    update_job,
)
from app.features.jobs.queries import Job as Job
from app.features.notifications.queries import NotificationKind
from app.features.notifications.service import notify_person
from app.features.people.visibility_queries import EVERYTHING, Visibility
from app.soccer.actors import person_of_actor

TICK = 0.25
"""Seconds between two looks at the progress of the running job."""

_REPORTED = {DONE: "done", FAILED: "it failed"}
"""Ends of jobs of which people are told, in words."""

Listener = Callable[[Job], None]
Then = Callable[[Session, Job], None]


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
            return require_job(session, job_id)

    def find(
        self,
        *,
        dataset_id: int | None = None,
        kinds: Sequence[str] = (),
        states: Sequence[str] = (),
        before: int | None = None,
        limit: int = 50,
        visibility: Visibility = EVERYTHING,
    ) -> list[Job]:
        """Jobs that somebody sees, the newest first; ``before`` is the last id of the page before."""
        with self._store.read() as session:
            return read_jobs(
                session,
                dataset_id=dataset_id,
                kinds=kinds,
                states=states,
                before=before,
                limit=limit,
                visibility=visibility,
            )

    def open_jobs(self, dataset_id: int | None, visibility: Visibility) -> list[Job]:
        """Jobs that somebody sees and that wait or run, the oldest first."""
        return self.find(dataset_id=dataset_id, states=OPEN, visibility=visibility)[::-1]

    def list_job_ids(self, *, dataset_id: int, kind: str) -> list[int]:
        """Ids of all jobs of a kind in a dataset, however many there are."""
        with self._store.read() as session:
            return list_job_ids_of_kind(session, dataset_id, kind)

    def forget(self, job_id: int) -> None:
        """Delete the record of a job that is over.

        Raises:
            NotFoundError: There is none of that id.
            ConflictError: It is not over.
        """
        with self._store.write() as session:
            if require_job(session, job_id).state in OPEN:
                raise ConflictError(f"job {job_id} has not ended yet", hint="Cancel it first.")
            delete_job(session, job_id)

    def _save_progress_until_ended(self, run: JobRun, ended: threading.Event) -> None:
        """Keep the record in step with the progress, off the work's own thread: the work may hold
        the write lock when it tells how far it is."""
        shown = run.progress.place
        while not ended.wait(TICK):
            if run.progress.place != shown:
                shown = run.progress.place
                with suppress(StorageError):
                    self._save_columns(run.job.id, **run.columns)

    def _save_columns(self, job_id: int, **values: Any) -> None:
        with self._store.write() as session:
            update_job(session, job_id, **values)
            job = read_job(session, job_id)
        if job is not None:
            self._announce_job_change(job)

    def _save_end(self, job_id: int, by: str | None = None, **values: Any) -> Job | None:
        """Save how a job ended, and tell who asked for it, at once; ``by``: see ``cancel``."""
        with self._store.write() as session:
            update_job(session, job_id, ended=find_end_time(session), **values)
            job = read_job(session, job_id)
            if job is not None:
                record_cancellation(session, job, by)
                notify_of_end(session, job)
        if job is not None:
            self._announce_job_change(job)
        return job

    def _announce_job_change(self, job: Job) -> None:
        for listener in self._listeners:
            listener(job)


def notify_of_end(session: Session, job: Job) -> None:
    """Tell who asked for a job that it is done or failed."""
    if job.state in _REPORTED:
        notify_person(
            session,
            person_of_actor(job.actor),
            NotificationKind.JOB,
            f"{job.title}: {_REPORTED[job.state]}",
            actor=job.actor,
            address="/jobs",
            dataset_id=job.dataset_id if job.dataset is not None else None,
        )


def require_job(session: Session, job_id: int) -> Job:
    """A job by its id; raises NotFoundError without one."""
    job = read_job(session, job_id)
    if job is None:
        raise NotFoundError(f"there is no job {job_id}")
    return job


def record_cancellation(session: Session, job: Job, by: str | None) -> Job:
    """Note who cancels a job and answer their request with it; None: it ends with other work."""
    if by is not None:
        add_audit_event(session, by, "job cancelled", job.dataset_id, job=job.id, title=job.title)
        session.respond(job)
    return job
