"""Edits of many views: which items go into one request, and one report of all requests."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from json import dumps
from typing import Any

from touchline.errors import ServerError

MAX_ITEMS = 200
"""Items of one request."""
MAX_POINTS = 2000
"""Points of the lines of one request."""
MAX_BRACKETS, MAX_COMMAS, MAX_BYTES = 4_900, 9_900, 500_000
"""Lists and objects, values and bytes of one body, as ``POST /datasets/{dataset}/edits`` takes it."""
_LIMITS = (MAX_ITEMS, MAX_POINTS, MAX_BRACKETS, MAX_COMMAS, MAX_BYTES)
_ITEM = re.compile(r"^/items/(\d+)\b")

Placed = tuple[int, Mapping[str, Any]]
"""An item with its place among all of them, from 0."""


def requests_of(items: Sequence[Mapping[str, Any]]) -> Iterator[list[Placed]]:
    """Items as they are sent: as many as a request may have, those of a group together."""
    together: dict[object, list[Placed]] = {}
    for place, item in enumerate(items):
        named = item.get("group") or item.get("etag") or place
        together.setdefault(named, []).append((place, item))
    chunk: list[Placed] = []
    size = [0] * len(_LIMITS)
    for part in together.values():
        own = [sum(numbers) for numbers in zip(*(_size(item) for _, item in part), strict=True)]
        after = [a + b for a, b in zip(size, own, strict=True)]
        if chunk and any(a > most for a, most in zip(after, _LIMITS, strict=True)):
            yield chunk
            chunk, after = [], own
        chunk, size = [*chunk, *part], after
    if chunk:
        yield chunk


def _size(item: Mapping[str, Any]) -> tuple[int, ...]:
    """What an item takes of each limit."""
    text = dumps(item)
    lines = (item.get("lines") or {}).values()
    points = sum(len(marking) for marking in lines if isinstance(marking, list))
    brackets = text.count("{") + text.count("[")
    return 1, points, brackets, text.count(",") + 1, len(text) + 2


def refusal(error: ServerError, index: int) -> dict[str, Any]:
    """What came of an item whose request was refused as a whole."""
    return {
        "index": index,
        "group": None,
        "view": None,
        "outcome": "refused",
        "etag": None,
        "status": error.status,
        "problem": error.message,
        "hint": error.hint,
        "pointer": error.pointer,
    }


def placed(one: Mapping[str, Any], places: Sequence[int]) -> dict[str, Any]:
    """An outcome with the places of items among all of them instead of those in its request."""

    def elsewhere(text: str | None) -> str | None:
        return text and _ITEM.sub(lambda found: f"/items/{places[int(found[1])]}", text)

    named = {name: elsewhere(one[name]) for name in ("problem", "pointer")}
    return {**one, **named, "index": places[one["index"]]}


def merged(report: Mapping[str, Any]) -> dict[str, Any]:
    """The report with its counts, its items in the order in which they were given."""
    items = sorted(report["items"], key=lambda one: one["index"])
    counts = Counter(one["outcome"] for one in items)
    named = {name: counts[name] for name in ("changed", "unchanged", "refused")}
    return {"dry_run": report["dry_run"], **named, "items": items}
