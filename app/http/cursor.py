"""Paging of lists: by `limit` and `cursor`, with `next`."""

from __future__ import annotations

import hashlib
import inspect
import re
from collections.abc import Awaitable, Callable, Mapping, Sequence
from functools import wraps
from typing import Annotated, Any, ParamSpec, TypeVar

from fastapi import Query
from pydantic import BaseModel

from app.errors import InputError
from app.http.documents import ListDocument
from app.json_text import MAX_ID, json_text

MAX_DIGITS = 18
"""Longer ones do not fit into the database."""


def parse_cursor(cursor: str | None) -> int | None:
    """The number that a cursor stands for; None for the first page.

    Raises:
        InputError: No list gave it.
    """
    if cursor is None:
        return None
    if not (cursor.isascii() and cursor.isdigit() and len(cursor) <= MAX_DIGITS):
        raise foreign_cursor_error()
    return int(cursor)


def parse_descending_cursor(cursor: str | None, before: int | None) -> int | None:
    """The number below which a page of a list that goes down begins; None for the first page.

    Args:
        cursor: As every list takes it.
        before: As these lists took it before; the cursor counts where both are there.

    Raises:
        InputError: No list gave the cursor.
    """
    return before if cursor is None else parse_cursor(cursor)


def foreign_cursor_error() -> InputError:
    """What to raise for a cursor that no list gave."""
    return InputError(
        "this is not a cursor of this list",
        hint="Send the `next` of the page before as it is.",
        pointer="/cursor",
    )


MAX_ITEMS = 1000
CURSOR_TEXT = "`next` of the page before; without it, the first page."
Cursor = Annotated[str | None, Query(max_length=60, description=CURSOR_TEXT)]
Before = Annotated[
    int | None,
    Query(ge=1, le=MAX_ID, description="What `cursor` is now: only what came before this id."),
]
"""Of lists that took it before there were cursors everywhere."""
_CURSOR = re.compile(r"(\d{1,9})\.([0-9a-f]{12})\.([0-9a-f]{8})", re.ASCII)
_NAMES = ("id", "key", "name", "path", "group", "view", "match", "field", "number")
"""What tells an item of a list from the others, so far as it has them."""

P = ParamSpec("P")
Answer = TypeVar("Answer")


def paged(default: int | None = None) -> Callable[[Callable[P, Answer]], Callable[..., Answer]]:
    """Let a route that makes a whole list answer it page by page.

    The route gets the parameters ``limit`` and ``cursor``. A page begins behind the item with
    which the one before ended, also where items came or went meanwhile.

    Args:
        default: Items a page where nobody says ``limit``; None: all.
    """

    def decorate(route: Callable[P, Answer]) -> Callable[..., Answer]:
        whose = f"{route.__module__}.{route.__qualname__}"

        def slice_answer(
            whole: Any, limit: int | None, cursor: str | None, arguments: Mapping[str, Any]
        ) -> Any:
            if not isinstance(whole, ListDocument):
                return whole
            items, following = slice_page(
                whole.items, limit, cursor, _hash_list_identity(whose, arguments)
            )
            return whole.model_copy(update={"items": items, "next": following})

        if inspect.iscoroutinefunction(route):
            waiting: Callable[..., Awaitable[Any]] = route

            @wraps(route)
            async def respond_with_page(
                *args: Any, limit: int | None = None, cursor: str | None = None, **requested: Any
            ) -> Any:
                return slice_answer(await waiting(*args, **requested), limit, cursor, requested)
        else:
            direct: Callable[..., Any] = route

            @wraps(route)
            def respond_with_page(
                *args: Any, limit: int | None = None, cursor: str | None = None, **requested: Any
            ) -> Any:
                return slice_answer(direct(*args, **requested), limit, cursor, requested)

        respond_with_page.__signature__ = _add_page_parameters(route, default)  # type: ignore[attr-defined]
        return respond_with_page  # type: ignore[return-value]

    return decorate


def slice_page(
    items: Sequence[Any], limit: int | None, cursor: str | None, whose: str
) -> tuple[list[Any], str | None]:
    """The items of a page, and the cursor of the next one.

    Args:
        items: Of the whole list, as it is now.
        limit: Items a page; None: all.
        cursor: ``next`` of the page before, or None.
        whose: Which list it is: a cursor of another one is refused.

    Raises:
        InputError: The cursor is none of this list.
    """
    start = 0 if cursor is None else _start_of_page(items, cursor, whose)
    end = len(items) if limit is None else min(start + limit, len(items))
    if end == len(items) or end == start:
        return list(items[start:end]), None
    return list(items[start:end]), f"{end - 1}.{_hash_item_identity(items[end - 1])}.{whose}"


def _start_of_page(items: Sequence[Any], cursor: str, whose: str) -> int:
    found = _CURSOR.fullmatch(cursor)
    if found is None or found[3] != whose:
        raise foreign_cursor_error()
    place = int(found[1])
    if place < len(items) and _hash_item_identity(items[place]) == found[2]:
        return place + 1
    now = (index for index, item in enumerate(items) if _hash_item_identity(item) == found[2])
    # Where the item is gone, the one behind it has moved into its place.
    return next((index + 1 for index in now), min(place, len(items)))


def _hash_item_identity(item: Any) -> str:
    value = item.model_dump(mode="json") if isinstance(item, BaseModel) else item
    if isinstance(value, dict):
        value = {name: value[name] for name in _NAMES if name in value} or value
    return hashlib.sha256(json_text(value).encode()).hexdigest()[:12]


def _hash_list_identity(route: str, arguments: Mapping[str, Any]) -> str:
    """Which list is asked for: the route, and what its address and query say."""
    texts = {name: value for name, value in arguments.items() if isinstance(value, str | int)}
    text = json_text([route, sorted(texts.items())])
    return hashlib.sha256(text.encode()).hexdigest()[:8]


def _add_page_parameters(route: Callable[..., Any], default: int | None) -> inspect.Signature:
    signature = inspect.signature(route, eval_str=True)
    if default is None:
        kind: Any = int | None
        text = "Items a page; without it, all."
    else:
        kind, text = int, "Items a page."
    wanted = Annotated[kind, Query(ge=1, le=MAX_ITEMS, description=text)]
    keyword = inspect.Parameter.KEYWORD_ONLY
    added = [
        inspect.Parameter("limit", keyword, default=default, annotation=wanted),
        inspect.Parameter("cursor", keyword, default=None, annotation=Cursor),
    ]
    given = [one.replace(kind=keyword) for one in signature.parameters.values()]
    return signature.replace(parameters=[*given, *added])
