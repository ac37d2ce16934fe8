"""The groups of a dataset that fulfil conditions: counted, read, put in order."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from sqlalchemy import (
    Column,
    ColumnElement,
    Label,
    Select,
    and_,
    case,
    false,
    func,
    not_,
    or_,
    select,
)
from sqlalchemy.orm import InstrumentedAttribute
from sqlalchemy.sql.visitors import iterate

from app.db.dialects.dialect import select_from_number_list
from app.db.session import Session
from app.features.agreement.queries import select_groups_in_agreement_state
from app.features.batches.queries import select_groups_in_batches
from app.features.comments.queries import select_groups_with_mentions, select_groups_with_threads
from app.features.independent_annotations.queries import select_groups_with_annotations
from app.features.paint.proposal_queries import select_groups_with_open_proposal
from app.features.people.visibility_queries import (
    visible_groups_across_datasets_condition,
    visible_groups_condition,
)
from app.features.policies.queries import find_policy_change_time
from app.features.queue.tables import QUEUE_NUMBERS, QUEUE_SCANNED, QueueModel
from app.features.solutions.queries import is_group_solved
from app.soccer.solution import GATES

Condition = ColumnElement[bool]
"""Whether a group is meant; made and combined by the functions here."""

_COMPARED: Mapping[str, Callable[[Any, Any], Any]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "=": operator.eq,
}
_NOT: Mapping[str, Callable[[Any, Any], Any]] = {
    "<": operator.ge,
    "<=": operator.gt,
    ">": operator.le,
    ">=": operator.lt,
    "=": operator.ne,
}


def compare_condition(column: str, op: str, value: float | str) -> Condition:
    """A number or text against a value, by one of < <= > >= =; nothing that is absent does.

    Turned round, what is absent does.
    """
    held = _queue_column(column)
    condition: Condition = _COMPARED[op](held, value)
    return and_(held.is_not(None), condition) if _TABLE.c[column].nullable else condition


def absent_condition(column: str) -> Condition:
    """There is no such number."""
    return _queue_column(column).is_(None)


def empty_text_condition(column: str) -> Condition:
    """There is no such text."""
    return or_(_queue_column(column).is_(None), _queue_column(column) == "")


def text_condition(column: str, text: str) -> Condition:
    """A text that may be absent is this one; turned round, it is another or absent."""
    return and_(_queue_column(column).is_not(None), _queue_column(column) == text)


def flag_condition(column: str, value: bool) -> Condition:
    """A flag is set, or is known not to be."""
    return _queue_column(column).is_(value)


def contains_text_condition(column: str, text: str) -> Condition:
    """A text holds another."""
    return _queue_column(column).contains(text, autoescape=True)


def has_list_item(column: str, item: str) -> Condition:
    """A list between commas has an item."""
    return contains_text_condition(column, f",{item},")


def has_all_pictures() -> Condition:
    """Every view has a picture."""
    return QueueModel.pictures >= QueueModel.views


def has_group_id(ids: Iterable[int]) -> Condition:
    """The group's id is one of these."""
    return QueueModel.group_id.in_(select_from_number_list(ids))


def has_open_proposal(outcome: str | None = None) -> Condition:
    """A view without a camera was looked at; with that outcome, where one is named."""
    return QueueModel.group_id.in_(select_groups_with_open_proposal(outcome))


def is_in_batch(ids: Iterable[int]) -> Condition:
    """The group is in one of these batches of work."""
    return QueueModel.group_id.in_(select_groups_in_batches(list(ids)))


def has_thread(state: str | None = None) -> Condition:
    """People have said something to each other about it; in an ``open`` or ``resolved`` thread."""
    return QueueModel.group_id.in_(select_groups_with_threads(state))


def mentions_person(name: str | None = None) -> Condition:
    """An open thread mentions somebody, or the person of a name."""
    return QueueModel.group_id.in_(select_groups_with_mentions(name))


def has_annotation_count(op: str, number: float) -> Condition:
    """So many people have handed in an annotation of their own; most groups have none."""
    if not _COMPARED[op](0, number):
        return QueueModel.group_id.in_(select_groups_with_annotations(_COMPARED[op], number))
    # The few that are not meant are looked up, instead of the many that are.
    return QueueModel.group_id.not_in(select_groups_with_annotations(_NOT[op], number))


def has_comparison_outcome(state: str) -> Condition:
    """Its annotations were compared, in some batch, and came to that."""
    return QueueModel.group_id.in_(select_groups_in_agreement_state(state))


def any_condition(conditions: Iterable[Condition]) -> Condition:
    """At least one of them holds."""
    return or_(*conditions)


def negate_condition(condition: Condition) -> Condition:
    """It does not hold."""
    return not_(condition)


def _queue_column(name: str) -> InstrumentedAttribute[Any]:
    column: InstrumentedAttribute[Any] = getattr(QueueModel, name)
    return column


Key = int | float | str | None
"""What a group is sorted by; None where it has no such number."""

_COMPUTED: Mapping[str, ColumnElement[Any]] = {
    "findings": func.length(QueueModel.findings)
    - func.length(func.replace(QueueModel.findings, ",", "")),
    "gate": case(
        {name: place for place, name in enumerate(GATES)}, value=QueueModel.gate, else_=None
    ),
}
"""Findings are sorted by how many kinds there are, gates by the order in which they are judged."""
SORTED = frozenset(("number", "status", *QUEUE_NUMBERS))
"""Columns by which an index sorts the groups of a dataset."""
_PRESENT = frozenset({"number", "changed", "views", "status", "split", "label"})
"""Columns that every row has."""


@dataclass(frozen=True)
class _SortKey:
    """One column of an order; rows without it come last either way."""

    column: Label[Any]
    descending: bool
    present: bool

    def sort_expression(self, *, backwards: bool) -> ColumnElement[Any]:
        """The ORDER BY of it. NULLS LAST lets an index of the plain column serve both ways."""
        sort = self.column.desc() if self.descending != backwards else self.column.asc()
        if self.present:
            return sort
        return sort.nulls_first() if backwards else sort.nulls_last()

    def equals(self, value: Key) -> ColumnElement[bool]:
        """Whether a row has this value."""
        return self.column.element.is_(None) if value is None else self.column.element == value

    def beyond_condition(self, value: Key, *, forward: bool) -> ColumnElement[bool]:
        """Whether a row's value comes after this one, or before it."""
        column = self.column.element
        if value is None:
            return false() if forward else column.is_not(None)
        further = column < value if self.descending == forward else column > value
        return further if self.present or not forward else or_(further, column.is_(None))


def _order_column(column: str | ColumnElement[Any]) -> Any:
    if not isinstance(column, str):
        return column
    return _COMPUTED.get(column, getattr(QueueModel, column))


class RowOrder:
    """A total order of groups: the number comes last, so that no two are equal.

    Groups without what is sorted by come last either way.

    Args:
        column: Name of a column of the queue, or what takes the place of one.
        descending: The largest first.
    """

    def __init__(self, column: str | ColumnElement[Any], descending: bool = False):
        name = column if isinstance(column, str) else ""
        keys = [(_order_column(column), descending, name in _PRESENT)]
        if name != "number":
            keys.append((QueueModel.number, False, True))
        self._keys = [
            _SortKey(key.label(f"key{place}"), down, present)
            for place, (key, down, present) in enumerate(keys)
        ]

        self.index = f"queue_{name}" if name in SORTED else None
        """Name of the index that has this order; None: there is none."""

    @property
    def keys(self) -> list[Label[Any]]:
        """The keys as columns."""
        return [key.column for key in self._keys]

    @property
    def order_by_columns(self) -> list[ColumnElement[Any]]:
        """ORDER BY of the order."""
        return [key.sort_expression(backwards=False) for key in self._keys]

    @property
    def reversed_order_by_columns(self) -> list[ColumnElement[Any]]:
        """ORDER BY of the reverse."""
        return [key.sort_expression(backwards=True) for key in self._keys]

    def keys_of(self, row: Any) -> list[Key]:
        """The keys of a row that was read with them."""
        return [getattr(row, key.name) for key in self.keys]

    def after_condition(self, values: Sequence[Key]) -> ColumnElement[bool]:
        """Whether a row comes after the one with these keys."""
        return self._after_or_before(values, forward=True)

    def before_condition(self, values: Sequence[Key]) -> ColumnElement[bool]:
        """Whether a row comes before the one with these keys."""
        return self._after_or_before(values, forward=False)

    def _after_or_before(self, values: Sequence[Key], forward: bool) -> ColumnElement[bool]:
        alternatives = []
        for place, (key, value) in enumerate(zip(self._keys, values, strict=True)):
            pairs = zip(self._keys[:place], values, strict=False)
            equal = [before.equals(other) for before, other in pairs]
            alternatives.append(and_(*equal, key.beyond_condition(value, forward=forward)))
        return or_(*alternatives)


_TABLE = QueueModel.__table__
_FILE_ORDER = "queue_number"
"""Groups lie in the file as they are numbered."""
_SCAN = "queue_scanned"
"""Most columns of every group in the same order, without the rest of their rows."""
_FEW = 10
"""Of so many groups that match, one page is looked for in order; of less, in all of them."""


@dataclass(frozen=True)
class GroupListing:
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
        found: int | None = self.session.scalar(self._filter_statement(select(func.count())))
        return found or 0

    def find_position_and_total(
        self, order: RowOrder, keys: Sequence[Key], group_id: int
    ) -> tuple[int | None, int]:
        """How many groups come before some keys, None where the group is not here; and how many
        there are."""
        here = func.sum(case((QueueModel.group_id == group_id, 1), else_=0))
        before = func.sum(case((order.before_condition(keys), 1), else_=0))
        statement = self._filter_statement(select(func.count(), here, before), order)
        total, found, index = self.session.execute(statement).one()
        return (index if found else None), total

    def columns(self, names: Iterable[str], *, by_number: bool = False) -> Sequence[Any]:
        """Some columns of each group."""
        names = list(names)
        needed = _collect_column_names(self.conditions) | set(names)
        statement = _hint_index(
            _choose_index(needed), _select_columns(names).where(*self._conditions)
        )
        if by_number:
            statement = statement.order_by(QueueModel.number)
        return self.session.execute(statement).all()

    def rows_after(self, order: RowOrder, keys: Sequence[Key] | None, limit: int) -> Sequence[Any]:
        """Rows in order with their keys, from the one after these keys on, or from the first."""
        after = [] if keys is None else [order.after_condition(keys)]
        statement = _select_rows(order).where(*self._conditions, *after).limit(limit)
        return self.session.execute(statement).all()

    def ids(self, order: RowOrder, limit: int | None = None) -> list[int]:
        """Ids in order, of all or of the first."""
        return self._read_ids(self._ids_statement.order_by(*order.order_by_columns).limit(limit))

    def ids_from(self, order: RowOrder, start: int, limit: int, total: int) -> list[int]:
        """Ids from a position on, in order, out of ``total``.

        SQLite sorts as many rows as it skips and reads, and wide rows cost it several times as
        much: hence ids alone, and behind the middle from the end.
        """
        count = min(limit, total - start)
        if count <= 0:
            return []
        behind = total - start - count
        ids = self._select_page_of_ids(order, min(start, behind) + count, total)
        if start <= behind:
            return self._read_ids(ids.order_by(*order.order_by_columns).offset(start).limit(count))
        backwards = ids.order_by(*order.reversed_order_by_columns).offset(behind).limit(count)
        return self._read_ids(backwards)[::-1]

    def ids_around(
        self, order: RowOrder, keys: Sequence[Key], limit: int, total: int
    ) -> tuple[list[int], list[int]]:
        """Ids just before some keys and just after, the nearest first, out of ``total``."""
        ids = self._select_page_of_ids(order, limit, total)
        before = (
            ids.where(order.before_condition(keys))
            .order_by(*order.reversed_order_by_columns)
            .limit(limit)
        )
        after = (
            ids.where(order.after_condition(keys)).order_by(*order.order_by_columns).limit(limit)
        )
        return self._read_ids(before), self._read_ids(after)

    @property
    def _conditions(self) -> list[ColumnElement[bool]]:
        seen = visible_groups_condition(self.dataset_id, QueueModel.group_id)
        return [QueueModel.dataset_id == self.dataset_id, *self.conditions, *seen]

    @property
    def _ids_statement(self) -> Select[int]:
        return select(QueueModel.group_id).where(*self._conditions)

    def _filter_statement(self, statement: Any, order: RowOrder | None = None) -> Select[Any]:
        """The statement over all groups."""
        filtered = statement.select_from(QueueModel).where(*self._conditions)
        names = _collect_column_names(self.conditions) | (
            set() if order is None else _collect_column_names(order.keys)
        )
        return (
            filtered if _is_covered_by_index(names) else _hint_index(_choose_index(names), filtered)
        )

    def _select_page_of_ids(self, order: RowOrder, reach: int, total: int) -> Select[int]:
        """Ids of which ``reach`` are read in order, out of ``total``."""
        few = self.conditions and reach * _FEW > total
        if few:
            return _hint_index(
                _choose_index(
                    _collect_column_names(self.conditions) | _collect_column_names(order.keys)
                ),
                self._ids_statement,
            )
        return _hint_index(order.index, self._ids_statement)

    def _read_ids(self, statement: Select[int]) -> list[int]:
        return list(self.session.scalars(statement))


def _collect_column_names(expressions: Iterable[ColumnElement[Any]]) -> set[str]:
    """Columns of the queue that expressions read."""
    return {
        part.name
        for expression in expressions
        for part in iterate(expression)
        if isinstance(part, Column) and part.table is _TABLE
    }


def _is_covered_by_index(names: set[str]) -> bool:
    """Whether one index holds all of these columns."""
    return names <= SORTED and len(names - {"number"}) <= 1


def _choose_index(names: set[str]) -> str:
    """The index through which all groups are read by their number, for these columns."""
    return _SCAN if names <= {*QUEUE_SCANNED, "dataset_id", "group_id"} else _FILE_ORDER


def _hint_index(index: str | None, statement: Select[Any]) -> Select[Any]:
    """The statement by an index, where there is one; SQLite would choose by what it guesses."""
    if index is None:
        return statement
    return statement.with_hint(QueueModel, f"INDEXED BY {index}", "sqlite")


def read_rows(session: Session, ids: Sequence[int], order: RowOrder) -> Sequence[Any]:
    """The rows of groups in order, with their keys."""
    return session.execute(_select_rows(order).where(QueueModel.group_id.in_(ids))).all()


def read_columns_of_groups(
    session: Session, ids: Sequence[int], conditions: Iterable[Condition], names: Iterable[str]
) -> Sequence[Any]:
    """Some columns of those among some groups of one dataset that fulfil conditions, by number."""
    # The dataset is not asked for: SQLite would look through all of it.
    statement = _select_columns(names).where(QueueModel.group_id.in_(ids), *conditions)
    return session.execute(statement.order_by(QueueModel.number)).all()


def read_columns_after(
    session: Session, dataset_id: int, names: Iterable[str], after: int, limit: int
) -> Sequence[Any]:
    """Some columns of the groups of a dataset by id, from the one after an id on."""
    mine = (QueueModel.dataset_id == dataset_id, QueueModel.group_id > after)
    statement = _select_columns(names).where(*mine).order_by(QueueModel.group_id).limit(limit)
    return session.execute(statement).all()


def find_dataset_and_sort_keys(
    session: Session, group_id: int, order: RowOrder
) -> tuple[int, list[Key]] | None:
    """The dataset of a group and its keys in an order; None where there is no such group."""
    statement = select(QueueModel.dataset_id, *order.keys).where(QueueModel.group_id == group_id)
    row = session.execute(statement).one_or_none()
    return None if row is None else (row.dataset_id, order.keys_of(row))


class StateCount(NamedTuple):
    """How many groups of a dataset have a status, and how many of these a solution."""

    dataset_id: int
    status: str
    groups: int
    solved: int


def count_states(session: Session, dataset_ids: Sequence[int]) -> Sequence[StateCount]:
    """How many groups datasets have of each status, and how many of these have a solution."""
    statement = (
        select(
            QueueModel.dataset_id,
            QueueModel.status,
            func.count().label("groups"),
            func.sum(case((QueueModel.solved, 1), else_=0)).label("solved"),
        )
        .where(
            QueueModel.dataset_id.in_(dataset_ids),
            *visible_groups_across_datasets_condition(QueueModel.dataset_id, QueueModel.group_id),
        )
        .group_by(QueueModel.dataset_id, QueueModel.status)
    )
    return session.rows(StateCount, statement)


def read_solving_backlog(session: Session) -> tuple[int, int, str | None]:
    """How many groups there are, how many wait to be solved, and since when (UTC) the one that
    waits longest does: from its last change, or from that of its dataset's policy where that came
    later; None: none waits."""
    total = session.scalar(select(func.count()).select_from(QueueModel)) or 0
    statement = (
        select(QueueModel.dataset_id, func.count(), func.min(QueueModel.changed))
        .where(not_(is_group_solved()))
        .group_by(QueueModel.dataset_id)
    )
    rows = session.execute(statement).all()
    since = [
        max(changed, find_policy_change_time(session, dataset) or "")
        for dataset, _, changed in rows
    ]
    return total, sum(count for _, count, _ in rows), min(since, default=None)


def count_reviewed_by_person_and_status(
    session: Session, dataset_id: int
) -> dict[tuple[str | None, str], int]:
    """How many groups have a verdict that counts, by who gave it and their status."""
    statement = (
        select(QueueModel.reviewer, QueueModel.status, func.count())
        .where(
            QueueModel.dataset_id == dataset_id,
            QueueModel.reviewer.is_not(None),
            *visible_groups_condition(dataset_id, QueueModel.group_id),
        )
        .group_by(QueueModel.reviewer, QueueModel.status)
    )
    return {(name, status): count for name, status, count in session.execute(statement)}


def _select_columns(names: Iterable[str]) -> Select[Any]:
    return select(*(getattr(QueueModel, name) for name in names))


def _select_rows(order: RowOrder) -> Select[Any]:
    return select(*QueueModel.__table__.columns, *order.keys).order_by(*order.order_by_columns)
