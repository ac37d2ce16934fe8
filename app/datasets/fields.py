"""Typed reading of one field of a record; what is wrong becomes a ValueError with a sentence."""

from __future__ import annotations

import math
import re
from typing import Any

from app.finite import quoted
from app.soccer.frames import MAX_PIXEL

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?", re.ASCII)


def number(value: Any) -> float:
    """A finite number; files also spell it as text.

    Raises:
        ValueError: Anything else, a truth value and a blank among it.
    """
    # Nearly all are, and an export asks for each corner of each box.
    if type(value) is float and math.isfinite(value):
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"is {_kind(value)}, not a number")
    if isinstance(value, str):
        return _number_of_text(value)
    try:
        result = float(value)
    except OverflowError:
        raise ValueError("is too large for a number") from None
    if not math.isfinite(result):
        raise ValueError(f"is {value}, not a finite number")
    return result


def _number_of_text(text: str) -> float:
    stripped = text.strip()
    if not stripped:
        raise ValueError("is blank")
    if len(stripped) > 400 or not _NUMBER.fullmatch(stripped):
        raise ValueError(f"is {quoted(stripped, 40)}, not a number")
    result = float(stripped)
    if not math.isfinite(result):
        raise ValueError("is too large for a number")
    return result


def pixel(value: Any) -> float:
    """A coordinate in an image, pixels; may lie outside the image, but not beyond reason.

    Raises:
        ValueError: Not a number, or more than a million pixels away.
    """
    result = number(value)
    if abs(result) > MAX_PIXEL:
        raise ValueError(f"is {result:g} pixels, which is beyond any image")
    return result


def whole(value: Any) -> int:
    """A whole number, also when spelt ``7.0`` or ``"7"``.

    Raises:
        ValueError: Anything else.
    """
    result = number(value)
    if result != int(result):
        raise ValueError(f"is {result:g}, not a whole number")
    return int(result)


def numbers(value: Any, count: int) -> tuple[float, ...]:
    """A list of ``count`` finite numbers.

    Raises:
        ValueError: Not a list, another length, or a member that is no number.
    """
    if not isinstance(value, (list, tuple)):
        raise ValueError(f"is {_kind(value)}, not a list of {count} numbers")
    if len(value) != count:
        raise ValueError(f"has {len(value)} numbers, not {count}")
    return tuple(number(item) for item in value)


def mapping(value: Any) -> dict[str, Any]:
    """A JSON object.

    Raises:
        ValueError: Anything else.
    """
    if not isinstance(value, dict):
        raise ValueError(f"is {_kind(value)}, not an object")
    return value


def sequence(value: Any) -> list[Any]:
    """A JSON list.

    Raises:
        ValueError: Anything else.
    """
    if not isinstance(value, (list, tuple)):
        raise ValueError(f"is {_kind(value)}, not a list")
    return list(value)


def _kind(value: Any) -> str:
    if value is None:
        return "null"
    names = {bool: "a truth value", str: "text", dict: "an object", list: "a list"}
    return names.get(type(value), "a number")
