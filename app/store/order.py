"""Order: a total order of groups, as their rows in the queue show them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, Label, and_, case, false, func, or_

from app.soccer.solution import GATES
from app.store.tables.queue import QUEUE_NUMBERS, QueueModel

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

    def sorted(self, *, backwards: bool) -> ColumnElement[Any]:
        """The ORDER BY of it. NULLS LAST lets an index of the plain column serve both ways."""
        sort = self.column.desc() if self.descending != backwards else self.column.asc()
        if self.present:
            return sort
        return sort.nulls_first() if backwards else sort.nulls_last()

    def equals(self, value: Key) -> ColumnElement[bool]:
        """Whether a row has this value."""
        return self.column.element.is_(None) if value is None else self.column.element == value

    def beyond(self, value: Key, *, forward: bool) -> ColumnElement[bool]:
        """Whether a row's value comes after this one, or before it."""
        column = self.column.element
        if value is None:
            return false() if forward else column.is_not(None)
        further = column < value if self.descending == forward else column > value
        return further if self.present or not forward else or_(further, column.is_(None))


def _value(column: str | ColumnElement[Any]) -> Any:
    if not isinstance(column, str):
        return column
    return _COMPUTED.get(column, getattr(QueueModel, column))


class Order:
    """A total order of groups: the number comes last, so that no two are equal.

    Groups without what is sorted by come last either way.

    Args:
        column: Name of a column of the queue, or what takes the place of one.
        descending: The largest first.
    """

    def __init__(self, column: str | ColumnElement[Any], descending: bool = False):
        name = column if isinstance(column, str) else ""
        keys = [(_value(column), descending, name in _PRESENT)]
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
    def ascending(self) -> list[ColumnElement[Any]]:
        """ORDER BY of the order."""
        return [key.sorted(backwards=False) for key in self._keys]

    @property
    def backwards(self) -> list[ColumnElement[Any]]:
        """ORDER BY of the reverse."""
        return [key.sorted(backwards=True) for key in self._keys]

    def keys_of(self, row: Any) -> list[Key]:
        """The keys of a row that was read with them."""
        return [getattr(row, key.name) for key in self.keys]

    def after(self, values: Sequence[Key]) -> ColumnElement[bool]:
        """Whether a row comes after the one with these keys."""
        return self._beyond(values, forward=True)

    def before(self, values: Sequence[Key]) -> ColumnElement[bool]:
        """Whether a row comes before the one with these keys."""
        return self._beyond(values, forward=False)

    def _beyond(self, values: Sequence[Key], forward: bool) -> ColumnElement[bool]:
        alternatives = []
        for place, (key, value) in enumerate(zip(self._keys, values, strict=True)):
            pairs = zip(self._keys[:place], values, strict=False)
            equal = [before.equals(other) for before, other in pairs]
            alternatives.append(and_(*equal, key.beyond(value, forward=forward)))
        return or_(*alternatives)
