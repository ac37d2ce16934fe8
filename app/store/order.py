"""Order: a total order of groups, as their rows in the queue show them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import ColumnElement, Label, and_, case, func, or_

from app.soccer.solution import GATES
from app.store.models import QueueModel

Key = int | float | str
"""What a group is sorted by."""

_COMPUTED: Mapping[str, ColumnElement[Any]] = {
    "findings": func.length(QueueModel.findings)
    - func.length(func.replace(QueueModel.findings, ",", "")),
    "gate": case(
        {name: place for place, name in enumerate(GATES)}, value=QueueModel.gate, else_=None
    ),
}
"""Findings are sorted by how many kinds there are, gates by the order in which they are judged."""
_TEXTS = frozenset({"status", "split", "reviewer", "label"})
_PRESENT = frozenset({"number", "changed"})
"""Columns that every row has, sorted by as they are."""


class Order:
    """A total order of groups: keys without NULL, the number last, so that no two are equal.

    Groups without the number that is sorted by come last either way.

    Args:
        column: Name of a column of the queue.
        descending: The largest first.
    """

    def __init__(self, column: str, descending: bool = False):
        value = _COMPUTED.get(column, getattr(QueueModel, column))
        keys: list[tuple[Any, bool]] = []
        if column in _PRESENT:
            keys.append((value, descending))
        else:
            keys.append((case((value.is_(None), 1), else_=0), False))
            keys.append((func.coalesce(value, "" if column in _TEXTS else 0.0), descending))
        if column != "number":
            keys.append((QueueModel.number, False))
        self._keys: list[tuple[Label[Any], bool]] = [
            (key.label(f"key{place}"), down) for place, (key, down) in enumerate(keys)
        ]

    @property
    def keys(self) -> list[Label[Any]]:
        """The keys as columns."""
        return [key for key, _ in self._keys]

    @property
    def ascending(self) -> list[ColumnElement[Any]]:
        """ORDER BY of the order."""
        return [key.desc() if down else key.asc() for key, down in self._keys]

    @property
    def backwards(self) -> list[ColumnElement[Any]]:
        """ORDER BY of the reverse."""
        return [key.asc() if down else key.desc() for key, down in self._keys]

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
        for place, (labelled, down) in enumerate(self._keys):
            equal = [
                key.element == value
                for (key, _), value in zip(self._keys[:place], values, strict=False)
            ]
            key, value = labelled.element, values[place]
            beyond = key < value if down == forward else key > value
            alternatives.append(and_(*equal, beyond))
        return or_(*alternatives)
