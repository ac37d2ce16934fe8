"""Listing: the groups of a dataset that fulfil conditions, counted, read and put in order."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Column, ColumnElement, Select, case, func, not_, select
from sqlalchemy.sql.visitors import iterate

from app.store.conditions import Condition
from app.store.order import SORTED, Key, Order
from app.store.policies import judged_since
from app.store.reader import seen_anywhere, seen_in
from app.store.session import Session
from app.store.solutions import is_solved
from app.store.tables.queue import QUEUE_SCANNED, QueueModel

_TABLE = QueueModel.__table__
_FILE_ORDER = "queue_number"
"""Groups lie in the file as they are numbered."""
_SCAN = "queue_scanned"
"""Most columns of every group in the same order, without the rest of their rows."""
_FEW = 10
"""Of so many groups that match, one page is looked for in order; of less, in all of them."""


@dataclass(frozen=True)
class Listing:
    """The groups of a dataset that fulfil all conditions, as a session sees them; those that are
    hidden from whoever asks are none of them.

    What an index sorts by is read from there. What no index holds is read in the order in which
    the rows lie in the file: to fetch them one by one as an index has them takes ten times as long.
    """

    session: Session
    dataset_id: int
    conditions: Sequence[Condition] = ()

    def count(self) -> int:
        """How many groups there are."""
        found: int | None = self.session.scalar(self._all(select(func.count())))
        return found or 0

    def place(self, order: Order, keys: Sequence[Key], group_id: int) -> tuple[int | None, int]:
        """How many groups come before some keys, None where the group is not here; and how many
        there are."""
        here = func.sum(case((QueueModel.group_id == group_id, 1), else_=0))
        before = func.sum(case((order.before(keys), 1), else_=0))
        statement = self._all(select(func.count(), here, before), order)
        total, found, index = self.session.execute(statement).one()
        return (index if found else None), total

    def columns(self, names: Iterable[str], *, by_number: bool = False) -> Sequence[Any]:
        """Some columns of each group."""
        names = list(names)
        asked = _names(self.conditions) | set(names)
        statement = _by(_through(asked), _columns(names).where(*self._where))
        if by_number:
            statement = statement.order_by(QueueModel.number)
        return self.session.execute(statement).all()

    def rows_after(self, order: Order, keys: Sequence[Key] | None, limit: int) -> Sequence[Any]:
        """Rows in order with their keys, from the one after these keys on, or from the first."""
        after = [] if keys is None else [order.after(keys)]
        statement = _rows(order).where(*self._where, *after).limit(limit)
        return self.session.execute(statement).all()

    def ids(self, order: Order, limit: int | None = None) -> list[int]:
        """Ids in order, of all or of the first."""
        return self._scalars(self._ids.order_by(*order.ascending).limit(limit))

    def ids_from(self, order: Order, start: int, limit: int, total: int) -> list[int]:
        """Ids from a position on, in order, out of ``total``.

        SQLite sorts as many rows as it skips and reads, and wide rows cost it several times as
        much: hence ids alone, and behind the middle from the end.
        """
        count = min(limit, total - start)
        if count <= 0:
            return []
        behind = total - start - count
        ids = self._page(order, min(start, behind) + count, total)
        if start <= behind:
            return self._scalars(ids.order_by(*order.ascending).offset(start).limit(count))
        backwards = ids.order_by(*order.backwards).offset(behind).limit(count)
        return self._scalars(backwards)[::-1]

    def ids_around(
        self, order: Order, keys: Sequence[Key], limit: int, total: int
    ) -> tuple[list[int], list[int]]:
        """Ids just before some keys and just after, the nearest first, out of ``total``."""
        ids = self._page(order, limit, total)
        before = ids.where(order.before(keys)).order_by(*order.backwards).limit(limit)
        after = ids.where(order.after(keys)).order_by(*order.ascending).limit(limit)
        return self._scalars(before), self._scalars(after)

    @property
    def _where(self) -> list[ColumnElement[bool]]:
        seen = seen_in(self.dataset_id, QueueModel.group_id)
        return [QueueModel.dataset_id == self.dataset_id, *self.conditions, *seen]

    @property
    def _ids(self) -> Select[int]:
        return select(QueueModel.group_id).where(*self._where)

    def _all(self, statement: Any, order: Order | None = None) -> Select[Any]:
        """The statement over all groups."""
        asked = statement.select_from(QueueModel).where(*self._where)
        names = _names(self.conditions) | (set() if order is None else _names(order.keys))
        return asked if _is_sorted(names) else _by(_through(names), asked)

    def _page(self, order: Order, reach: int, total: int) -> Select[int]:
        """Ids of which ``reach`` are read in order, out of ``total``."""
        few = self.conditions and reach * _FEW > total
        if few:
            return _by(_through(_names(self.conditions) | _names(order.keys)), self._ids)
        return _by(order.index, self._ids)

    def _scalars(self, statement: Select[int]) -> list[int]:
        return list(self.session.scalars(statement))


def _names(expressions: Iterable[ColumnElement[Any]]) -> set[str]:
    """Columns of the queue that expressions read."""
    return {
        part.name
        for expression in expressions
        for part in iterate(expression)
        if isinstance(part, Column) and part.table is _TABLE
    }


def _is_sorted(names: set[str]) -> bool:
    """Whether one index holds all of these columns."""
    return names <= SORTED and len(names - {"number"}) <= 1


def _through(names: set[str]) -> str:
    """The index through which all groups are read by their number, for these columns."""
    return _SCAN if names <= {*QUEUE_SCANNED, "dataset_id", "group_id"} else _FILE_ORDER


def _by(index: str | None, statement: Select[Any]) -> Select[Any]:
    """The statement by an index, where there is one; SQLite would choose by what it guesses."""
    if index is None:
        return statement
    return statement.with_hint(QueueModel, f"INDEXED BY {index}", "sqlite")


def read_rows(session: Session, ids: Sequence[int], order: Order) -> Sequence[Any]:
    """The rows of groups in order, with their keys."""
    return session.execute(_rows(order).where(QueueModel.group_id.in_(ids))).all()


def read_columns(
    session: Session, ids: Sequence[int], conditions: Iterable[Condition], names: Iterable[str]
) -> Sequence[Any]:
    """Some columns of those among some groups of one dataset that fulfil conditions, by number."""
    # The dataset is not asked for: SQLite would look through all of it.
    statement = _columns(names).where(QueueModel.group_id.in_(ids), *conditions)
    return session.execute(statement.order_by(QueueModel.number)).all()


def columns_from(
    session: Session, dataset_id: int, names: Iterable[str], after: int, limit: int
) -> Sequence[Any]:
    """Some columns of the groups of a dataset by id, from the one after an id on."""
    mine = (QueueModel.dataset_id == dataset_id, QueueModel.group_id > after)
    statement = _columns(names).where(*mine).order_by(QueueModel.group_id).limit(limit)
    return session.execute(statement).all()


def find_place(session: Session, group_id: int, order: Order) -> tuple[int, list[Key]] | None:
    """The dataset of a group and its keys in an order; None where there is no such group."""
    statement = select(QueueModel.dataset_id, *order.keys).where(QueueModel.group_id == group_id)
    row = session.execute(statement).one_or_none()
    return None if row is None else (row.dataset_id, order.keys_of(row))


def count_states(session: Session, dataset_ids: Sequence[int]) -> Sequence[Any]:
    """Rows (dataset_id, status, groups, solved): how many groups there are, and have a solution."""
    statement = (
        select(
            QueueModel.dataset_id,
            QueueModel.status,
            func.count().label("groups"),
            func.sum(case((QueueModel.solved, 1), else_=0)).label("solved"),
        )
        .where(
            QueueModel.dataset_id.in_(dataset_ids),
            *seen_anywhere(QueueModel.dataset_id, QueueModel.group_id),
        )
        .group_by(QueueModel.dataset_id, QueueModel.status)
    )
    return session.execute(statement).all()


def count_unsolved(session: Session) -> tuple[int, int, str | None]:
    """How many groups there are, how many wait to be solved, and since when (UTC) the one that
    waits longest does: from its last change, or from that of its dataset's policy where that came
    later; None: none waits."""
    total = session.scalar(select(func.count()).select_from(QueueModel)) or 0
    statement = (
        select(QueueModel.dataset_id, func.count(), func.min(QueueModel.changed))
        .where(not_(is_solved()))
        .group_by(QueueModel.dataset_id)
    )
    rows = session.execute(statement).all()
    since = [max(changed, judged_since(session, dataset) or "") for dataset, _, changed in rows]
    return total, sum(count for _, count, _ in rows), min(since, default=None)


def count_reviewed(session: Session, dataset_id: int) -> dict[tuple[str | None, str], int]:
    """How many groups have a verdict that counts, by who gave it and their status."""
    statement = (
        select(QueueModel.reviewer, QueueModel.status, func.count())
        .where(
            QueueModel.dataset_id == dataset_id,
            QueueModel.reviewer.is_not(None),
            *seen_in(dataset_id, QueueModel.group_id),
        )
        .group_by(QueueModel.reviewer, QueueModel.status)
    )
    return {(name, status): count for name, status, count in session.execute(statement)}


def _columns(names: Iterable[str]) -> Select[Any]:
    return select(*(getattr(QueueModel, name) for name in names))


def _rows(order: Order) -> Select[Any]:
    return select(*QueueModel.__table__.columns, *order.keys).order_by(*order.ascending)
