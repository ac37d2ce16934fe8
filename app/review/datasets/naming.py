"""Naming: what people may call a dataset, and what belongs to one."""

from __future__ import annotations

import re

from app.errors import InputError
from app.finite import quoted

MAX_TITLE = 80
"""Characters of what only people read."""
_NAME = re.compile(r"[A-Za-z0-9](?:[A-Za-z0-9._ -]{0,98}[A-Za-z0-9._-])?")


def require_name(
    name: str, what: str, *, digits: bool = False, pointer: str | None = "/name"
) -> None:
    """Raise unless something that addresses and files name can be called so.

    Args:
        name: The name.
        what: What is called so, such as ``a dataset``.
        digits: Whether digits alone are a name, too, and not taken for an id.
        pointer: Where the name stands in a request.

    Raises:
        InputError: It cannot.
    """
    if not _NAME.fullmatch(name) or (name.isdigit() and not digits):
        alone = "" if digits else ", not digits alone"
        raise InputError(
            f"{quoted(name)} cannot be the name of {what}",
            hint=f"Use letters, digits, spaces and . _ -, up to 100, with no space at either end{alone}.",
            pointer=pointer,
        )


def checked_title(text: str, what: str) -> str:
    """What people read as the name of something, without white space around it.

    Args:
        text: As it was typed.
        what: What is called so, such as ``a batch``.

    Raises:
        InputError: It is empty, too long, or holds what cannot be printed.
    """
    text = text.strip()
    if not text or len(text) > MAX_TITLE or not text.isprintable():
        raise InputError(f"{what} has a name of 1 to {MAX_TITLE} letters", pointer="/name")
    return text
