"""Vitals: the few numbers that tell how a database is doing, each from an index or a header."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from app.config import Settings
from app.store.first_look import log_file
from app.store.job_models import JobModel
from app.store.models import LogModel, QueueModel
from app.store.policies import judged_since


@dataclass(frozen=True)
class Vitals:
    """How a database is doing.

    Attributes:
        groups: How many there are.
        unsolved: How many wait to be solved.
        oldest_unsolved: Since when the one that waits longest does (UTC): from its last change, or
            from that of its dataset's policy where that came later; None: none waits.
        entries: Length of the log.
        jobs: How many jobs there are, by kind and state.
    """

    groups: int
    unsolved: int
    oldest_unsolved: str | None
    entries: int
    jobs: Mapping[tuple[str, str], int]


def read_vitals(session: Session) -> Vitals:
    """The vitals of this moment."""
    groups = session.scalar(select(func.count()).select_from(QueueModel)) or 0
    unsolved, oldest = _waiting(session)
    entries = session.scalar(select(func.max(LogModel.id))) or 0
    kinds = select(JobModel.kind, JobModel.state, func.count())
    jobs = session.execute(kinds.group_by(JobModel.kind, JobModel.state)).all()
    return Vitals(
        groups, unsolved, oldest, entries, Counter({(row[0], row[1]): row[2] for row in jobs})
    )


def _waiting(session: Session) -> tuple[int, str | None]:
    """How many groups wait to be solved, and since when the one that waits longest does."""
    statement = (
        select(QueueModel.dataset_id, func.count(), func.min(QueueModel.changed))
        .where(QueueModel.solved.is_(False))
        .group_by(QueueModel.dataset_id)
    )
    rows = session.execute(statement).all()
    since = [max(changed, judged_since(session, dataset) or "") for dataset, _, changed in rows]
    return sum(count for _, count, _ in rows), min(since, default=None)


def file_sizes(settings: Settings) -> dict[str, int]:
    """Bytes of the database and of its write-ahead log, where they are."""
    database, sizes = settings.database_file, {}
    for name, path in {"database": database, "wal": log_file(database)}.items():
        # SQLite deletes its log when the last connection is closed.
        with suppress(FileNotFoundError):
            sizes[name] = path.stat().st_size
    return sizes
