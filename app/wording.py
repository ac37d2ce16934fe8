"""Wording: counts and numbers in sentences, one form and one rounding for each, wherever they stand."""

from __future__ import annotations

import re
import unicodedata

_PLURAL_END = re.compile(r"(?:(?<=x)|(?<=ss))es\b|s\b")


def plural(count: int, one: str, several: str | None = None) -> str:
    """A count and what is counted; ``several``: None is ``one`` with an s.

    Example:
        >>> plural(1, "group"), plural(12764, "match", "matches")
        ('1 group', '12,764 matches')
    """
    return f"{count:,} {one if count == 1 else several or f'{one}s'}"


_TURNS = "\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"


def is_visible(text: str) -> bool:
    """Whether a text has a character that leaves a mark."""
    return any(unicodedata.category(character)[0] not in "ZC" for character in text)


def is_one_line(text: str) -> bool:
    r"""Whether a text that people typed has no control character, no end of a line, nor turns the direction of
    what stands beside it.

    Example:
        >>> is_one_line("\u30dc\u30fc\u30eb\u3000\u78ba\u8a8d"), is_one_line("two\nlines")
        (True, False)
    """
    return not any(
        unicodedata.category(character) in ("Cc", "Cs", "Zl", "Zp") or character in _TURNS
        for character in text
    )


def format_named_count(count: int, name: str) -> str:
    """A count under the name that a report has for several.

    Example:
        >>> format_named_count(1, "images_missing"), format_named_count(2, "balls")
        ('1 image missing', '2 balls')
    """
    several = name.replace("_", " ")
    return plural(count, _PLURAL_END.sub("", several, count=1), several)


_BEYOND_PX = 20_000
"""No picture is as large."""


def format_pixels(value: float) -> str:
    """A distance in a picture.

    Example:
        >>> format_pixels(7.26), format_pixels(241.1), format_pixels(1720.0), format_pixels(31_000.0)
        ('7.3 px', '241 px', '1,720 px', '>20,000 px')
    """
    size = abs(value)
    if size >= _BEYOND_PX:
        return f">{_BEYOND_PX:,} px"
    return f"{value:,.{0 if size >= 99.95 else 1}f} px"


def format_percent(value: float) -> str:
    """Per cent, without its sign.

    Example:
        >>> format_percent(0.057), format_percent(14.28), format_percent(113.0)
        ('0.06', '14.3', '113')
    """
    size = abs(value)
    return f"{value:.{0 if size >= 99.95 else 1 if size >= 9.995 else 2}f}"


def format_metres(value: float) -> str:
    """A place or its uncertainty on the pitch.

    Example:
        >>> format_metres(0.067)
        '0.07 m'
    """
    return f"{value:.2f} m"


def format_degrees(value: float) -> str:
    """An angle.

    Example:
        >>> format_degrees(44.46)
        '44.5°'
    """
    return f"{value:.1f}°"
