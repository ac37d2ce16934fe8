"""Jobs in the database: what is under way and what came of it, newest first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import Index, case, delete, false, func, insert, select, update
from sqlalchemy.orm import Mapped, mapped_column

from app.db.dialects.dialect import json_member
from app.db.json_columns import Json, parse_json_column
from app.db.session import Base, Session, format_utc_time, now
from app.features.datasets.tables import DatasetModel
from app.features.groups.insert_queries import find_next_row_id, reserve_row_ids
from app.features.people.visibility_queries import (
    EVERYTHING,
    Visibility,
    list_columns_with_shown_actor,
)
from app.json_text import canonical_json_text, replace_non_finite
from app.soccer.choices import JobState

WAITING: JobState = "waiting"
RUNNING: JobState = "running"
DONE: JobState = "done"
FAILED: JobState = "failed"
CANCELLED: JobState = "cancelled"
EXPORT = "export"
"""The kind of job whose row is the only way to its file."""
OPEN = (WAITING, RUNNING)
"""States that are not the last one of a job."""
SUBJECT = ("recording", "first", "last", "link")
"""What of a job's request says what it works on, and nothing else of it."""


class JobModel(Base):
    """A piece of background work and how far it is.

    ``tries`` counts the times that it was begun and neither ended nor was stopped in good order.
    ``ending``: somebody wants the running one to end. ``request`` (JSON) is what it was asked for, enough to start it again where its kind can be;
    ``result`` and ``problem`` (JSON) are what came of it. A dataset may be gone before its jobs.
    """

    __tablename__ = "job"
    __table_args__ = (Index("job_dataset", "dataset_id", "id"), Index("job_kind", "kind", "id"))

    id: Mapped[int] = mapped_column(primary_key=True)
    kind: Mapped[str]
    title: Mapped[str]
    dataset_id: Mapped[int | None]
    state: Mapped[str]
    done: Mapped[int]
    total: Mapped[int | None]
    sentence: Mapped[str]
    request: Mapped[str | None]
    result: Mapped[str | None]
    problem: Mapped[str | None]
    created: Mapped[str]
    started: Mapped[str | None]
    ended: Mapped[str | None]
    actor: Mapped[str]
    tries: Mapped[int] = mapped_column(server_default="0")
    ending: Mapped[bool] = mapped_column(server_default=false())


@dataclass(frozen=True)
class Job:
    """A piece of background work as it stands.

    Attributes:
        dataset: Name of its dataset; None where it has none, or that is gone. Of an import the
            name that it was asked for, until the dataset is there.
        state: ``waiting``, ``running``, ``done``, ``failed`` or ``cancelled``.
        total: How much there is to do; None while that is unknown.
        sentence: What it is at, for people.
        request: What it was asked for.
        problem: ``{"detail", "hint", "pointer"}`` of what failed.
        tries: How often it was begun and neither ended nor was stopped in good order.
        ending: Somebody wants the running one to end.
    """

    id: int
    kind: str
    title: str
    dataset_id: int | None
    dataset: str | None
    state: str
    done: int
    total: int | None
    sentence: str
    request: Json
    result: Json
    problem: Json
    created: str
    started: str | None
    ended: str | None
    actor: str
    tries: int
    ending: bool = False

    @property
    def subject(self) -> dict[str, Json] | None:
        """Which recording, frames of it, link or practice it works on; None where it is about something else."""
        asked = self.request if isinstance(self.request, dict) else {}
        if self.kind == "practice":
            return {"practice": "recording" if asked.get("recording") else "groups"}
        return {key: asked[key] for key in SUBJECT if type(asked.get(key)) is int} or None


@dataclass(frozen=True)
class NewJob:
    """What a job is from its start."""

    kind: str
    title: str
    actor: str
    dataset_id: int | None = None
    request: Json = None


def insert_job(session: Session, job: NewJob) -> int:
    """Insert a job that waits; returns its id."""
    identity = find_next_row_id(session, JobModel)
    values = {
        "id": identity,
        "kind": job.kind,
        "title": job.title,
        "dataset_id": job.dataset_id,
        "actor": job.actor,
        "state": WAITING,
        "done": 0,
        "sentence": "",
        "tries": 0,
        "request": _to_json_column(job.request),
        "created": now(),
    }
    session.execute(insert(JobModel), [values])
    return identity


def find_end_time(session: Session) -> str:
    """When a job ends whose end is written now: later than every end before it, whatever the clock says, since
    webhooks are told of ends in that order."""
    at, last = now(), session.scalar(select(func.max(JobModel.ended)))
    if last is None or last < at:
        return at
    return format_utc_time(datetime.fromisoformat(last) + timedelta(microseconds=1))


def update_job(session: Session, job_id: int, *, begun: int = 0, **values: Any) -> None:
    """Set columns of a job; ``result`` and ``problem`` are JSON values, ``begun`` adds to its tries."""
    if begun:
        values["tries"] = JobModel.tries + begun
    for name in ("result", "problem"):
        if name in values:
            values[name] = _to_json_column(values[name])
    session.execute(update(JobModel).where(JobModel.id == job_id).values(values))


def read_job(session: Session, job_id: int) -> Job | None:
    """A job by its id."""
    row = session.execute(_SELECT.where(JobModel.id == job_id)).one_or_none()
    return None if row is None else _job_from_row(row)


def read_jobs(
    session: Session,
    *,
    dataset_id: int | None = None,
    kinds: Sequence[str] = (),
    states: Sequence[str] = (),
    before: int | None = None,
    limit: int = 50,
    visibility: Visibility = EVERYTHING,
) -> list[Job]:
    """Jobs, the newest first.

    Args:
        session: Any session.
        dataset_id: Of this dataset alone.
        kinds: Of these kinds alone.
        states: In these states alone.
        before: Those older than the job of this id.
        limit: How many at most.
        visibility: Those that somebody sees.
    """
    statement = _SELECT.order_by(JobModel.id.desc()).limit(limit)
    if dataset_id is not None:
        statement = statement.where(JobModel.dataset_id == dataset_id)
    seen = visibility.condition(JobModel.dataset_id, JobModel.actor)
    if seen is not None:
        statement = statement.where(seen)
    if kinds:
        statement = statement.where(JobModel.kind.in_(kinds))
    if states:
        statement = statement.where(JobModel.state.in_(states))
    if before is not None:
        statement = statement.where(JobModel.id < before)
    return [_job_from_row(row) for row in session.execute(statement)]


def list_job_ids_of_kind(session: Session, dataset_id: int, kind: str) -> list[int]:
    """Ids of all jobs of a kind in a dataset."""
    mine = (JobModel.dataset_id == dataset_id, JobModel.kind == kind)
    return list(session.scalars(select(JobModel.id).where(*mine).order_by(JobModel.id)))


def list_job_ids_of_dataset(
    session: Session, dataset_id: int, kinds: Sequence[str], states: Sequence[str]
) -> list[int]:
    """Ids of a dataset's jobs in some states, of some kinds or, without any, of all."""
    found = select(JobModel.id).where(JobModel.dataset_id == dataset_id, JobModel.state.in_(states))
    if kinds:
        found = found.where(JobModel.kind.in_(kinds))
    return list(session.scalars(found.order_by(JobModel.id)))


def is_cancellation_requested(session: Session, job_id: int) -> bool:
    """Whether somebody wants a running job to end."""
    return bool(session.scalar(select(JobModel.ending).where(JobModel.id == job_id)))


def count_jobs(session: Session) -> dict[tuple[str, str], int]:
    """How many jobs there are, by kind and state."""
    kinds = select(JobModel.kind, JobModel.state, func.count())
    rows = session.execute(kinds.group_by(JobModel.kind, JobModel.state))
    return {(kind, state): number for kind, state, number in rows}


def delete_job(session: Session, job_id: int) -> None:
    """Forget one job."""
    reserve_row_ids(session, JobModel)
    session.execute(delete(JobModel).where(JobModel.id == job_id))


def delete_oldest_jobs(session: Session, kind: str, keep: int) -> None:
    """Forget the oldest jobs of a kind that are over, so that the table does not grow forever."""
    reserve_row_ids(session, JobModel)
    oldest = (
        select(JobModel.id)
        .where(JobModel.kind == kind, JobModel.state.not_in(OPEN))
        .order_by(JobModel.id.desc())
        .offset(keep)
    )
    session.execute(delete(JobModel).where(JobModel.id.in_(oldest)))


def delete_old_jobs(session: Session, days: int) -> int:
    """Forget jobs that ended so many days ago; one that made an export stays as long as its file.

    Returns:
        How many.
    """
    reserve_row_ids(session, JobModel)
    oldest = format_utc_time(datetime.now(UTC) - timedelta(days=days))
    gone = (
        delete(JobModel)
        .where(JobModel.state.not_in(OPEN), JobModel.ended < oldest)
        .where((JobModel.kind != EXPORT) | (JobModel.state != "done"))
        .returning(JobModel.id)
    )
    return len(session.scalars(gone).all())


def _to_json_column(value: Json) -> str | None:
    return None if value is None else canonical_json_text(replace_non_finite(value))


def _job_from_row(row: Any) -> Job:
    values = dict(row._mapping)
    for name in ("request", "result", "problem"):
        values[name] = None if values[name] is None else parse_json_column(values[name])
    return Job(**values)


_TO_BE = case(
    (
        (JobModel.kind == "import") & JobModel.dataset_id.is_(None),
        json_member(JobModel.request, "dataset"),
    )
)
_SELECT = select(
    *list_columns_with_shown_actor(JobModel),
    func.coalesce(DatasetModel.name, _TO_BE).label("dataset"),
).outerjoin(DatasetModel, DatasetModel.id == JobModel.dataset_id)
