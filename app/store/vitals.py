"""Vitals: the few numbers that tell how a database is doing, each from an index or a header."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from app.store.job_models import JobModel
from app.store.models import LogModel, QueueModel


@dataclass(frozen=True)
class Vitals:
    """How a database is doing.

    Attributes:
        groups: How many there are.
        unsolved: How many wait to be solved.
        oldest_unsolved: When the one that waits longest was changed (UTC); None: none waits.
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
    waiting = select(func.count(), func.min(QueueModel.changed)).where(QueueModel.solved.is_(False))
    unsolved, oldest = session.execute(waiting).one()
    entries = session.scalar(select(func.max(LogModel.id))) or 0
    kinds = select(JobModel.kind, JobModel.state, func.count())
    jobs = session.execute(kinds.group_by(JobModel.kind, JobModel.state)).all()
    return Vitals(
        groups, unsolved, oldest, entries, Counter({(row[0], row[1]): row[2] for row in jobs})
    )


def file_sizes(home: Path) -> dict[str, int]:
    """Bytes of the database and of its write-ahead log."""
    paths = {"database": home / "touchline.db", "wal": home / "touchline.db-wal"}
    return {name: path.stat().st_size for name, path in paths.items() if path.exists()}
