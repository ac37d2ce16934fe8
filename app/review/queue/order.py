"""Order: the total order in which a query lists groups, and the cursors of its pages."""

from __future__ import annotations

import base64
import binascii
import json
from collections.abc import Sequence
from typing import Any

from sqlalchemy import ColumnElement, Label, and_, case, func, or_

from app.errors import InputError
from app.finite import json_text
from app.review.queue.query import SORTS, TEXT_SORTS, Query
from app.store.models import QueueModel

_LARGEST = 2**63 - 1
"""No key of a row is beyond; NaN is not below it either."""


class Order:
    """A total order of groups: keys without NULL, the number last, so that no two are equal.

    Groups without the number that is sorted by come last either way.
    """

    def __init__(self, query: Query):
        self.name = query.sort + ("-desc" if query.descending else "")
        column = SORTS[query.sort]
        keys: list[tuple[Any, bool]] = []
        if query.sort not in ("number", "newest"):
            keys.append((case((column.is_(None), 1), else_=0), False))
            absent = "" if query.sort in TEXT_SORTS else 0.0
            keys.append((func.coalesce(column, absent), query.descending))
        else:
            # "newest" says the direction itself.
            keys.append((column, query.descending != (query.sort == "newest")))
        if query.sort != "number":
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

    def after(self, values: Sequence[Any]) -> ColumnElement[bool]:
        """Whether a row comes after the one with these keys."""
        return self._beyond(values, forward=True)

    def before(self, values: Sequence[Any]) -> ColumnElement[bool]:
        """Whether a row comes before the one with these keys."""
        return self._beyond(values, forward=False)

    def _beyond(self, values: Sequence[Any], forward: bool) -> ColumnElement[bool]:
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

    def encode(self, row: Any) -> str:
        """The cursor that continues after a row."""
        values = [getattr(row, key.name) for key in self.keys]
        text = json_text([self.name, *values], ascii_=True, compact=True)
        return base64.urlsafe_b64encode(text.encode()).decode().rstrip("=")

    def decode(self, cursor: str) -> list[Any]:
        """The keys of a cursor; raises InputError when it is none of this query's."""
        try:
            padded = cursor + "=" * (-len(cursor) % 4)
            text = base64.b64decode(padded, altchars=b"-_", validate=True)
            name, *values = json.loads(text)
        except (binascii.Error, ValueError, TypeError) as error:
            raise InputError("the cursor is damaged", pointer="/cursor") from error
        sound = all(map(_is_key, values))
        if name != self.name or len(values) != len(self._keys) or not sound:
            raise InputError(
                "this cursor came from another query; ask for the first page of this one",
                pointer="/cursor",
            )
        return list(values)


def _is_key(value: Any) -> bool:
    """Whether the database can compare with a value: no NaN, no Infinity, no endless integer."""
    if isinstance(value, str):
        return True
    if not isinstance(value, (int, float)):
        return False
    return abs(value) <= _LARGEST
