"""Cursors of lists that are read by number: the number after which the next page begins."""

from __future__ import annotations

from app.errors import InputError

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
        raise foreign_cursor()
    return int(cursor)


def first_below(cursor: str | None, before: int | None) -> int | None:
    """The number below which a page of a list that goes down begins; None for the first page.

    Args:
        cursor: As every list takes it.
        before: As these lists took it before; the cursor counts where both are there.

    Raises:
        InputError: No list gave the cursor.
    """
    return before if cursor is None else parse_cursor(cursor)


def foreign_cursor() -> InputError:
    """What to raise for a cursor that no list gave."""
    return InputError(
        "this is not a cursor of this list",
        hint="Send the `next` of the page before as it is.",
        pointer="/cursor",
    )
