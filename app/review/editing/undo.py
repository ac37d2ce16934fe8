"""Undo and redo: two stacks per group (or station) that follow from the log alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.store.models import LogModel

GROUP_KINDS = {"edit": "edit", "undo": "undo", "redo": "redo"}
STATION_KINDS = {"station_edit": "edit", "station_undo": "undo", "station_redo": "redo"}


@dataclass(frozen=True)
class Stacks:
    """Ids of log entries: the last of ``done`` is what undo takes back, of ``undone`` what redo
    does again."""

    done: tuple[int, ...] = ()
    undone: tuple[int, ...] = ()

    @property
    def can_undo(self) -> bool:
        """Whether there is an edit to take back."""
        return bool(self.done)

    @property
    def can_redo(self) -> bool:
        """Whether there is an edit to do again."""
        return bool(self.undone)


def stacks_of(entries: Iterable[tuple[int, str]]) -> Stacks:
    """The stacks after entries (id and ``edit``, ``undo`` or ``redo``) in their order.

    An undo moves the last edit over, a redo moves it back, and a fresh edit clears what was
    undone.
    """
    done: list[int] = []
    undone: list[int] = []
    for number, kind in entries:
        if kind == "edit":
            done.append(number)
            undone.clear()
        elif kind == "undo":
            undone.append(done.pop())
        else:
            done.append(undone.pop())
    return Stacks(tuple(done), tuple(undone))


def read_stacks(session: Session, group_ids: Sequence[int]) -> Mapping[int, Stacks]:
    """The stacks of each group."""
    statement = (
        select(LogModel.group_id, LogModel.id, LogModel.kind)
        .where(LogModel.group_id.in_(group_ids), LogModel.kind.in_(GROUP_KINDS))
        .order_by(LogModel.id)
    )
    entries: dict[int, list[tuple[int, str]]] = {number: [] for number in group_ids}
    for row in session.execute(statement):
        entries[row.group_id].append((row.id, GROUP_KINDS[row.kind]))
    return {number: stacks_of(items) for number, items in entries.items()}


def read_station_stacks(session: Session, station_id: int) -> Stacks:
    """The stacks of a shared station."""
    statement = (
        select(LogModel.id, LogModel.kind)
        .where(LogModel.station_id == station_id, LogModel.kind.in_(STATION_KINDS))
        .order_by(LogModel.id)
    )
    rows = session.execute(statement)
    return stacks_of((row.id, STATION_KINDS[row.kind]) for row in rows)
