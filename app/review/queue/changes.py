"""Changes: what others want to hear of, read from the log, whoever wrote it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from app.review.editing.etags import read_etags
from app.store.models import DatasetModel, GroupModel, LogModel, SolutionModel, ViewModel

MANY = 200
"""So many groups of one dataset at once are told as one change of the dataset."""
FAR = 5000
"""Who was away for more entries than this is told to read everything anew."""
EVERYTHING = "everything"
"""Kind of a change of a dataset in which nothing can be taken to be as it was."""
SOLVED = "solved"
"""Kind of a change that nobody said: a solution arrived."""


@dataclass(frozen=True)
class Change:
    """A group that is not what it was, or, without a group, a dataset.

    Attributes:
        id: Id of the last log entry that it tells of; None for what is not logged.
        dataset: Its name; None where it is gone.
        etag: Of the group as it is now.
        kind: As in the log, or ``solved``.
        actor: Who did it last; None where nobody did.
    """

    id: int | None
    dataset_id: int
    dataset: str | None
    kind: str
    actor: str | None
    group_id: int | None = None
    etag: str | None = None


def newest_entry(session: Session) -> int:
    """Id of the log's last entry; 0 for an empty log."""
    return session.scalar(select(func.max(LogModel.id))) or 0


def newest_solution(session: Session) -> int:
    """Id of the last solution; 0 where there is none."""
    return session.scalar(select(func.max(SolutionModel.id))) or 0


def read_changes(session: Session, after: int) -> list[Change]:
    """What has changed since an entry of the log, each group once, in the order of the log."""
    newest = newest_entry(session)
    if newest - after > FAR:
        rows = session.execute(select(DatasetModel.id, DatasetModel.name))
        return [Change(newest, row.id, row.name, EVERYTHING, None) for row in rows]
    return _told(session, list(_entries(session, after)))


def read_solved(session: Session, after: int, known: Iterable[int | None] = ()) -> list[Change]:
    """Groups that got a solution after another one; ``known`` are told of already."""
    statement = (
        select(GroupModel.dataset_id, GroupModel.id)
        .join(SolutionModel, SolutionModel.group_id == GroupModel.id)
        .where(SolutionModel.id > after)
        .distinct()
    )
    told = set(known)
    found = [
        _Found(None, row.dataset_id, row.id, SOLVED, None)
        for row in session.execute(statement)
        if row.id not in told
    ]
    return _told(session, found)


@dataclass(frozen=True)
class _Found:
    id: int | None
    dataset_id: int
    group_id: int | None
    kind: str
    actor: str | None


def _entries(session: Session, after: int) -> Iterator[_Found]:
    """Log entries, in order; a static camera's stand once for each of its groups."""
    columns = (LogModel.id, LogModel.dataset_id, LogModel.kind, LogModel.actor)
    plain = select(*columns, LogModel.group_id).where(
        LogModel.id > after, LogModel.dataset_id.is_not(None)
    )
    of_station = (
        select(*columns, ViewModel.group_id)
        .join(ViewModel, ViewModel.station_id == LogModel.station_id)
        .where(LogModel.id > after, LogModel.group_id.is_(None), LogModel.dataset_id.is_not(None))
        .distinct()
    )
    rows = [*session.execute(plain), *session.execute(of_station)]
    for row in sorted(rows, key=lambda row: int(row.id)):
        yield _Found(row.id, row.dataset_id, row.group_id, row.kind, row.actor)


def _told(session: Session, found: Iterable[_Found]) -> list[Change]:
    """Changes with names and ETags; a dataset with too many of them is told as a whole."""
    items = _merged(found)
    sizes = Counter(item.dataset_id for item in items if item.group_id is not None)
    items = _merged(
        replace(item, group_id=None) if sizes[item.dataset_id] > MANY else item for item in items
    )
    names = _names(session, {item.dataset_id for item in items})
    etags = read_etags(session, [item.group_id for item in items if item.group_id is not None])
    return [
        Change(
            item.id,
            item.dataset_id,
            names.get(item.dataset_id),
            item.kind,
            item.actor,
            item.group_id,
            None if item.group_id is None else etags[item.group_id],
        )
        for item in items
        # A group that is gone by now is told of by its dataset's own entries.
        if item.group_id is None or item.group_id in etags
    ]


def _merged(found: Iterable[_Found]) -> list[_Found]:
    """The last change of each group, and the last one of each kind of each dataset, in order."""
    last = {
        (item.dataset_id, item.group_id, "" if item.group_id else item.kind): item for item in found
    }
    return sorted(last.values(), key=lambda item: item.id or 0)


def _names(session: Session, ids: set[int]) -> dict[int, str]:
    rows = session.execute(
        select(DatasetModel.id, DatasetModel.name).where(DatasetModel.id.in_(ids))
    )
    return {row.id: row.name for row in rows}
