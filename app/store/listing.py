"""Listing: the groups of a dataset that fulfil conditions, counted, read and put in order."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, Integer, Select, cast, func, select
from sqlalchemy.orm import Session

from app.store.conditions import Condition
from app.store.models import QueueModel
from app.store.order import Key, Order
from app.store.policies import judged_since


@dataclass(frozen=True)
class Listing:
    """The groups of a dataset that fulfil all conditions, as a session sees them."""

    session: Session
    dataset_id: int
    conditions: Iterable[Condition] = ()

    def count(self) -> int:
        """How many groups there are."""
        statement = select(func.count()).select_from(QueueModel).where(*self._where)
        return self.session.scalar(statement) or 0

    def columns(self, names: Iterable[str], *, by_number: bool = False) -> Sequence[Any]:
        """Some columns of each group."""
        statement = _columns(names).where(*self._where)
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
        if start <= behind:
            return self._scalars(self._ids.order_by(*order.ascending).offset(start).limit(count))
        backwards = self._ids.order_by(*order.backwards).offset(behind).limit(count)
        return self._scalars(backwards)[::-1]

    def ids_around(
        self, order: Order, keys: Sequence[Key], limit: int
    ) -> tuple[list[int], list[int]]:
        """Ids just before some keys and just after, the nearest first."""
        before = self._ids.where(order.before(keys)).order_by(*order.backwards).limit(limit)
        after = self._ids.where(order.after(keys)).order_by(*order.ascending).limit(limit)
        return self._scalars(before), self._scalars(after)

    @property
    def _where(self) -> list[ColumnElement[bool]]:
        return [QueueModel.dataset_id == self.dataset_id, *self.conditions]

    @property
    def _ids(self) -> Select[int]:
        return select(QueueModel.group_id).where(*self._where)

    def _scalars(self, statement: Select[int]) -> list[int]:
        return list(self.session.scalars(statement))


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
            func.sum(cast(QueueModel.solved, Integer)).label("solved"),
        )
        .where(QueueModel.dataset_id.in_(dataset_ids))
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
        .where(QueueModel.solved.is_(False))
        .group_by(QueueModel.dataset_id)
    )
    rows = session.execute(statement).all()
    since = [max(changed, judged_since(session, dataset) or "") for dataset, _, changed in rows]
    return total, sum(count for _, count, _ in rows), min(since, default=None)


def count_reviewed(session: Session, dataset_id: int) -> dict[tuple[str | None, str], int]:
    """How many groups have a verdict that counts, by who gave it and their status."""
    statement = (
        select(QueueModel.reviewer, QueueModel.status, func.count())
        .where(QueueModel.dataset_id == dataset_id, QueueModel.reviewer.is_not(None))
        .group_by(QueueModel.reviewer, QueueModel.status)
    )
    return {(name, status): count for name, status, count in session.execute(statement)}


def _columns(names: Iterable[str]) -> Select[Any]:
    return select(*(getattr(QueueModel, name) for name in names))


def _rows(order: Order) -> Select[Any]:
    return select(*QueueModel.__table__.columns, *order.keys).order_by(*order.ascending)
