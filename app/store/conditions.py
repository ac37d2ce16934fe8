"""Conditions on groups, as their rows in the queue show them; columns go by their names."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from sqlalchemy import ColumnElement, and_, not_, or_
from sqlalchemy.orm import InstrumentedAttribute

from app.store.agreement import groups_that_came_to
from app.store.dialect.statements import numbers_in
from app.store.proposals import groups_with_open
from app.store.tables.queue import QueueModel
from app.store.takes import groups_with_takes
from app.store.threads import groups_that_mention, groups_with_threads
from app.store.work import groups_in_batches

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


def compares(column: str, op: str, value: float | str) -> Condition:
    """A number or text against a value, by one of < <= > >= =; nothing that is absent does."""
    condition: Condition = _COMPARED[op](_column(column), value)
    return condition


def is_absent(column: str) -> Condition:
    """There is no such number."""
    return _column(column).is_(None)


def is_empty(column: str) -> Condition:
    """There is no such text."""
    return or_(_column(column).is_(None), _column(column) == "")


def is_text(column: str, text: str) -> Condition:
    """A text that may be absent is this one; turned round, it is another or absent."""
    return and_(_column(column).is_not(None), _column(column) == text)


def is_flag(column: str, value: bool) -> Condition:
    """A flag is set, or is known not to be."""
    return _column(column).is_(value)


def contains(column: str, text: str) -> Condition:
    """A text holds another."""
    return _column(column).contains(text, autoescape=True)


def lists(column: str, item: str) -> Condition:
    """A list between commas has an item."""
    return contains(column, f",{item},")


def has_all_pictures() -> Condition:
    """Every view has a picture."""
    return QueueModel.pictures >= QueueModel.views


def is_one_of(ids: Iterable[int]) -> Condition:
    """The group's id is one of these."""
    return QueueModel.group_id.in_(numbers_in(ids))


def has_open_proposal(outcome: str | None = None) -> Condition:
    """A view without a camera was looked at; with that outcome, where one is named."""
    return QueueModel.group_id.in_(groups_with_open(outcome))


def is_in_batch(ids: Iterable[int]) -> Condition:
    """The group is in one of these batches of work."""
    return QueueModel.group_id.in_(groups_in_batches(list(ids)))


def has_thread(state: str | None = None) -> Condition:
    """People have said something to each other about it; in an ``open`` or ``resolved`` thread."""
    return QueueModel.group_id.in_(groups_with_threads(state))


def mentions(name: str | None = None) -> Condition:
    """An open thread mentions somebody, or the person of a name."""
    return QueueModel.group_id.in_(groups_that_mention(name))


def has_takes(op: str, number: float) -> Condition:
    """So many people have handed in an annotation of their own; most groups have none."""
    if not _COMPARED[op](0, number):
        return QueueModel.group_id.in_(groups_with_takes(_COMPARED[op], number))
    # The few that are not meant are looked up, instead of the many that are.
    return QueueModel.group_id.not_in(groups_with_takes(_NOT[op], number))


def came_to(state: str) -> Condition:
    """Its annotations were compared, in some batch, and came to that."""
    return QueueModel.group_id.in_(groups_that_came_to(state))


def either(conditions: Iterable[Condition]) -> Condition:
    """At least one of them holds."""
    return or_(*conditions)


def opposite(condition: Condition) -> Condition:
    """It does not hold."""
    return not_(condition)


def _column(name: str) -> InstrumentedAttribute[Any]:
    column: InstrumentedAttribute[Any] = getattr(QueueModel, name)
    return column
