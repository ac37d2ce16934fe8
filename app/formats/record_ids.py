"""Ids by which one record of a file refers to another: one id, however it is spelt."""

from __future__ import annotations

import re
from typing import Any, Generic, TypeVar

T = TypeVar("T")

_DECIMAL = re.compile(r"([+-]?\d{1,40})\.0*", re.ASCII)
_WHOLE = re.compile(r"[+-]?\d{1,40}", re.ASCII)


def id_text(value: Any) -> str | None:
    """The text of an id; None for what is none (null, a truth value, a list, an object).

    Example:
        >>> id_text(1), id_text(1.0), id_text(" 1.0 "), id_text("a7"), id_text(True)
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
        text = id_text(value)
        if text is None or text in self._texts:
            return False
        self._texts[text] = item
        if _WHOLE.fullmatch(text):
            self._numbers.setdefault(int(text), []).append(item)
        return True

    def find(self, value: Any) -> T | None:
        """The record of an id; None where there is none, or several are equal as numbers."""
        text = id_text(value)
        if text is None:
            return None
        if text in self._texts:
            return self._texts[text]
        equal = self._numbers.get(int(text), []) if _WHOLE.fullmatch(text) else []
        return equal[0] if len(equal) == 1 else None
