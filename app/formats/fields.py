"""Fields of records: read with a clear error, written exactly.

A record may declare the size of its picture.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any, Generic, TypeVar

from app.json_text import quote_text
from app.soccer.frames import MAX_PIXEL, MAX_SIDE, ImageSize

T = TypeVar("T")

_DECIMAL = re.compile(r"([+-]?\d{1,40})\.0*", re.ASCII)
_WHOLE = re.compile(r"[+-]?\d{1,40}", re.ASCII)


def id_to_text(value: Any) -> str | None:
    """The text of an id; None for what is none (null, a truth value, a list, an object).

    Example:
        >>> id_to_text(1), id_to_text(1.0), id_to_text(" 1.0 "), id_to_text("a7"), id_to_text(True)
        ('1', '1', '1', 'a7', None)
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return None
    if isinstance(value, float):
        return str(int(value)) if value.is_integer() else repr(value)
    if isinstance(value, int):
        # More digits than Python turns into text are no id.
        return str(value) if abs(value) < 10**40 else None
    text = value.strip()
    decimal = _DECIMAL.fullmatch(text)
    return decimal[1] if decimal else text or None


class IdIndex(Generic[T]):
    """Records by id: ``1``, ``1.0`` and ``"1"`` are one id, and so is ``"001"`` where no other fits."""

    def __init__(self) -> None:
        self._texts: dict[str, T] = {}
        self._numbers: dict[int, list[T]] = {}

    def add(self, value: Any, item: T) -> bool:
        """Add a record; False where the value is no id, or another record has it."""
        text = id_to_text(value)
        if text is None or text in self._texts:
            return False
        self._texts[text] = item
        if _WHOLE.fullmatch(text):
            self._numbers.setdefault(int(text), []).append(item)
        return True

    def find(self, value: Any) -> T | None:
        """The record of an id; None where there is none, or several are equal as numbers."""
        text = id_to_text(value)
        if text is None:
            return None
        if text in self._texts:
            return self._texts[text]
        equal = self._numbers.get(int(text), []) if _WHOLE.fullmatch(text) else []
        return equal[0] if len(equal) == 1 else None


_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?", re.ASCII)


def parse_number(value: Any) -> float:
    """A finite number; files also spell it as text.

    Raises:
        ValueError: Anything else, booleans and blanks included.
    """
    # Nearly all are, and an export asks for each corner of each box.
    if type(value) is float and math.isfinite(value):
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"is {_describe_value_kind(value)}, not a number")
    if isinstance(value, str):
        return _parse_number_text(value)
    try:
        result = float(value)
    except OverflowError:
        raise ValueError("is too large for a number") from None
    if not math.isfinite(result):
        raise ValueError(f"is {value}, not a finite number")
    return result


def _parse_number_text(text: str) -> float:
    stripped = text.strip()
    if not stripped:
        raise ValueError("is blank")
    if len(stripped) > 400 or not _NUMBER.fullmatch(stripped):
        raise ValueError(f"is {quote_text(stripped, 40)}, not a number")
    result = float(stripped)
    if not math.isfinite(result):
        raise ValueError("is too large for a number")
    return result


def parse_pixel_coordinate(value: Any) -> float:
    """A coordinate in an image, pixels; at most a million pixels outside the image.

    Raises:
        ValueError: Not a number, or more than a million pixels away.
    """
    result = parse_number(value)
    if abs(result) > MAX_PIXEL:
        raise ValueError(f"is {result:g} pixels, which is beyond any image")
    return result


def parse_whole_number(value: Any) -> int:
    """A whole number, also when spelt ``7.0`` or ``"7"``.

    Raises:
        ValueError: Anything else.
    """
    result = parse_number(value)
    if result != int(result):
        raise ValueError(f"is {result:g}, not a whole number")
    return int(result)


def parse_numbers(value: Any, count: int) -> tuple[float, ...]:
    """A list of ``count`` finite numbers.

    Raises:
        ValueError: Not a list, another length, or a member that is no number.
    """
    if not isinstance(value, (list, tuple)):
        raise ValueError(f"is {_describe_value_kind(value)}, not a list of {count} numbers")
    if len(value) != count:
        raise ValueError(f"has {len(value)} numbers, not {count}")
    return tuple(parse_number(item) for item in value)


def require_object(value: Any) -> dict[str, Any]:
    """A JSON object.

    Raises:
        ValueError: Anything else.
    """
    if not isinstance(value, dict):
        raise ValueError(f"is {_describe_value_kind(value)}, not an object")
    return value


def require_list(value: Any) -> list[Any]:
    """A JSON list.

    Raises:
        ValueError: Anything else.
    """
    if not isinstance(value, (list, tuple)):
        raise ValueError(f"is {_describe_value_kind(value)}, not a list")
    return list(value)


def _describe_value_kind(value: Any) -> str:
    if value is None:
        return "null"
    names = {bool: "a truth value", str: "text", dict: "an object", list: "a list"}
    return names.get(type(value), "a number")


_SIDES = (("width", "height"), ("image_width", "image_height"), ("imageWidth", "imageHeight"))
_PAIRS = ("image_size", "img_size", "resolution")


def parse_image_size(value: Mapping[str, Any]) -> ImageSize | None:
    """Width and height in pixels; None where the record states none that an image can have.

    Example:
        >>> parse_image_size({"image_size": [1280, 720]})
        ImageSize(width=1280, height=720)
    """
    pairs = [[value.get(width), value.get(height)] for width, height in _SIDES]
    for pair in (*pairs, *(value.get(name) for name in _PAIRS)):
        try:
            width, height = map(parse_whole_number, parse_numbers(pair, 2))
        except ValueError:
            continue
        if min(width, height) >= 2 and max(width, height) <= MAX_SIDE:
            return ImageSize(width, height)
    return None


_STEPS = 4


def find_exact_inverse(guess: float, target: float, read: Callable[[float], float]) -> float:
    """The number next to ``guess`` from which ``read`` makes exactly ``target``.

    A reader that multiplies or subtracts rounds, and so does the writer's inverse; without this
    a value would wander by a last digit with every export and import.

    Args:
        guess: The inverse but for rounding.
        target: What must be read.
        read: What the reader does with the number in the file.

    Returns:
        The guess where no neighbour is exact, which happens only to values that no file held.
    """
    below = above = guess
    for _ in range(_STEPS):
        if read(below) == target:
            return below
        if read(above) == target:
            return above
        below, above = math.nextafter(below, -math.inf), math.nextafter(above, math.inf)
    return guess
