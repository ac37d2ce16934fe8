"""Changes in the database: which groups the log and the solutions tell of since some row."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from sqlalchemy import select

from app.store.log import DEEDS
from app.store.session import Session
from app.store.tables.groups import GroupModel, ViewModel
from app.store.tables.log import LogModel
from app.store.tables.solutions import SolutionModel


@dataclass(frozen=True)
class StoredChange:
    """Something that happened to a dataset, or to one of its groups; ``id`` is its log entry's."""

    id: int | None
    dataset_id: int
    kind: str
    actor: str | None
    group_id: int | None


def logged_changes(session: Session, after: int) -> Iterator[StoredChange]:
    """What the log tells after an entry, in order; a static camera's stand once for each group."""
    columns = (LogModel.id, LogModel.dataset_id, LogModel.kind, LogModel.actor)
    new = (
        LogModel.id > after,
        LogModel.dataset_id.is_not(None),
        LogModel.kind.not_in(DEEDS),
    )
    plain = select(*columns, LogModel.group_id).where(*new)
    of_station = (
        select(*columns, ViewModel.group_id)
        .join(ViewModel, ViewModel.station_id == LogModel.station_id)
        .where(*new, LogModel.group_id.is_(None))
        .distinct()
    )
    rows = [*session.execute(plain), *session.execute(of_station)]
    for row in sorted(rows, key=lambda row: int(row.id)):
        yield StoredChange(*row)


def solved_groups(session: Session, after: int) -> list[tuple[int, int]]:
    """Dataset and id of each group that got a solution after another one."""
    statement = (
        select(GroupModel.dataset_id, GroupModel.id)
        .join(SolutionModel, SolutionModel.group_id == GroupModel.id)
        .where(SolutionModel.id > after)
        .distinct()
        .order_by(GroupModel.dataset_id, GroupModel.id)
    )
    return [(row.dataset_id, row.id) for row in session.execute(statement)]
