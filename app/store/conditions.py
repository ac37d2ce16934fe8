"""Conditions on groups, as their rows in the queue show them; columns go by their names."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from sqlalchemy import ColumnElement, and_, func, not_, or_, select
from sqlalchemy.orm import InstrumentedAttribute

from app.finite import json_text
from app.store.models import QueueModel
from app.store.proposals import groups_with_open

Condition = ColumnElement[bool]
"""Whether a group is meant; made and combined by the functions here."""

_COMPARED: Mapping[str, Callable[[Any, Any], Any]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "=": operator.eq,
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
    # One parameter, however many there are: a statement takes a limited number of them.
    listed = func.json_each(json_text(list(ids))).table_valued("value")
    return QueueModel.group_id.in_(select(listed.c.value))


def has_open_proposal(outcome: str | None = None) -> Condition:
    """A view without lines was looked at for a proposal; with that outcome, where one is named."""
    return QueueModel.group_id.in_(groups_with_open(outcome))


def either(conditions: Iterable[Condition]) -> Condition:
    """At least one of them holds."""
    return or_(*conditions)


def opposite(condition: Condition) -> Condition:
    """It does not hold."""
    return not_(condition)


def _column(name: str) -> InstrumentedAttribute[Any]:
    column: InstrumentedAttribute[Any] = getattr(QueueModel, name)
    return column
