"""Identity cache: what was made of the last values that a function was given."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from threading import Lock
from typing import Generic, TypeVar

T = TypeVar("T")
R = TypeVar("R")


class IdentityCache(Generic[T, R]):
    """Calls a function once for each value; the value itself is the key, not what it equals.

    For frozen values that are expensive to hash and live as long as their own cache keeps them.

    Args:
        make: The function; it depends on nothing but the value and what is given beside it.
        size: How many results are kept; the one that was not asked for the longest goes first.
    """

    def __init__(self, make: Callable[..., R], size: int):
        self._make, self._size = make, size
        self._lock = Lock()
        self._kept: OrderedDict[int, tuple[T, tuple[object, ...], R]] = OrderedDict()

    def __call__(self, value: T, *beside: object) -> R:
        """What the function makes of the value; what is beside it counts by what it equals."""
        key = id(value)
        with self._lock:
            # A value that is kept lives, so no other has its id.
            if key in self._kept and self._kept[key][1] == beside:
                self._kept.move_to_end(key)
                return self._kept[key][2]
        made = self._make(value, *beside)
        with self._lock:
            self._kept[key] = value, beside, made
            self._kept.move_to_end(key)
            if len(self._kept) > self._size:
                self._kept.popitem(last=False)
        return made
