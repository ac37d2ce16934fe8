"""Cursors: where a page of a query ends, as a text that the next request sends."""

from __future__ import annotations

import base64
import binascii
import json
from collections.abc import Sequence
from typing import Any

from app.errors import InputError
from app.finite import MAX_ID, json_text
from app.review.queue.query import Query
from app.store.order import Key


def encode(query: Query, keys: Sequence[Key]) -> str:
    """The cursor that continues after the row with these keys."""
    text = json_text([_name(query), *keys], ascii_=True, compact=True)
    return base64.urlsafe_b64encode(text.encode()).decode().rstrip("=")


def decode(query: Query, cursor: str) -> list[Key]:
    """The keys of a cursor; raises InputError when it is none of this query's."""
    try:
        padded = cursor + "=" * (-len(cursor) % 4)
        text = base64.b64decode(padded, altchars=b"-_", validate=True)
        name, *values = json.loads(text)
    except (binascii.Error, ValueError, TypeError) as error:
        raise InputError("the cursor is damaged", pointer="/cursor") from error
    sound = all(map(_is_key, values))
    if name != _name(query) or len(values) != len(query.order.keys) or not sound:
        raise InputError(
            "this cursor came from another query; ask for the first page of this one",
            pointer="/cursor",
        )
    return list(values)


def _name(query: Query) -> str:
    """What tells a query from others: its order, and a digest of its conditions."""
    order = query.sort + ("-desc" if query.descending else "")
    if query.batch is not None:
        order = f"batch {query.batch}"
    return f"{order} {query.digest}"


def _is_key(value: Any) -> bool:
    """Whether the database can compare with a value: no NaN, no Infinity, no endless integer."""
    if value is None or isinstance(value, str):
        return True
    if not isinstance(value, (int, float)):
        return False
    # No key of a row is beyond; NaN is not below it either.
    return abs(value) <= MAX_ID
