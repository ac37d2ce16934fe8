"""Counts in a sentence: one thing, or several."""

from __future__ import annotations

import re

_PLURAL_END = re.compile(r"(?:(?<=x)|(?<=ss))es\b|s\b")


def plural(count: int, one: str, several: str | None = None) -> str:
    """A count and what is counted; ``several``: None is ``one`` with an s.

    Example:
        >>> plural(1, "group"), plural(12764, "match", "matches")
        ('1 group', '12,764 matches')
    """
    return f"{count:,} {one if count == 1 else several or f'{one}s'}"


def counted(count: int, name: str) -> str:
    """A count under the name that a report has for several.

    Example:
        >>> counted(1, "images_missing"), counted(2, "balls")
        ('1 image missing', '2 balls')
    """
    several = name.replace("_", " ")
    return plural(count, _PLURAL_END.sub("", several, count=1), several)
